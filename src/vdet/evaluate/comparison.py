"""Truth beside predictions, frame by frame: what every metric starts from."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from vdet.evaluate.labelled_video import Integers
from vdet.geometry import Float64Array


@dataclass(frozen=True, slots=True, eq=False)
class ComparedFrame:
    """The vehicles and the predictions that count in a frame.

    Attributes
    ----------
    number
        Of the frame, from 1.
    vehicles, tracks
        int64 `(n,)` and `(m,)`: which true vehicle and which predicted track each box is; an index
        into the `vehicle_ids` and `track_ids` of the `Comparison`.
    vehicle_boxes, track_boxes
        float64 `(n, 4)` and `(m, 4)`: x, y, width, height in full-frame pixels.
    scores
        float64 `(m,)`: confidence of the predictions.
    iou
        float64 `(n, m)`.
    """

    number: int
    vehicles: Integers
    tracks: Integers
    vehicle_boxes: Float64Array
    track_boxes: Float64Array
    scores: Float64Array
    iou: Float64Array


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """The frames of a video that have a vehicle or a prediction, in order.

    Attributes
    ----------
    frames
        Of several pooled videos they stand end to end.
    vehicle_ids, track_ids
        int64: the id in its file of every vehicle and track that has a box in `frames`.
    seconds
        Length of the video, None where it is not known.
    """

    frames: tuple[ComparedFrame, ...]
    vehicle_ids: Integers
    track_ids: Integers
    seconds: float | None

    def vehicle_lengths(self) -> Integers:
        """Return the number of boxes of every vehicle, int64."""
        return counts((frame.vehicles for frame in self.frames), len(self.vehicle_ids))

    def track_lengths(self) -> Integers:
        """Return the number of boxes of every track, int64."""
        return counts((frame.tracks for frame in self.frames), len(self.track_ids))


def counts(indices: Iterable[Integers], length: int) -> Integers:
    """Return how often each of 0 … `length` - 1 occurs in all `indices` together, int64."""
    return np.bincount(joined(indices), minlength=length)


def joined(arrays: Iterable[Integers]) -> Integers:
    """Return one-dimensional arrays end to end; an empty one where there are none."""
    return np.concatenate([np.empty(0, np.int64), *arrays])
