"""Which windows of a labelled frame become patches."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from vdet.config.schema import MiningSettings
from vdet.detect.detections import Detections
from vdet.detect.svm.windows import Windows
from vdet.evaluate.labelled_video import LabelledVideo
from vdet.geometry import BoolArray, Box, coverage
from vdet.learn.dataset import Sides
from vdet.learn.mining.placing import Placing, place

Kind = Literal["vehicle", "box", "false alarm", "part"]
"""`vehicle`: the window fits a vehicle. `box`: it shows one off its centre or of another size.
`false alarm`: it is taken for a vehicle, but there is none. `part`: it is taken for a vehicle, but
shows only a part of one."""

_MOST_COVERED = 0.3
"""Largest share of a false alarm that a vehicle or an ignore region may cover."""


@dataclass(frozen=True, slots=True)
class Choice:
    """A window that becomes a patch, and the sides of the vehicle in it."""

    kind: Kind
    box: Box
    sides: Sides | None


def choose(
    windows: Windows,
    truth: LabelledVideo,
    frame_width: int,
    settings: MiningSettings,
    rng: np.random.Generator,
) -> Iterator[Choice]:
    """Choose from the windows of a frame, of each kind as many as the settings allow.

    Parameters
    ----------
    windows
        All windows of the frame, with the probabilities of the model that is to be improved.
    truth
        The rows of this frame.
    """
    _, first = np.unique(windows.boxes, axis=0, return_index=True)
    boxes = windows.boxes[first].astype(np.float64)
    suspicious = windows.probabilities[first] >= settings.probability
    vehicles = truth.boxes[~truth.ignored]
    placings = [place(boxes, vehicle, frame_width) for vehicle in vehicles]
    covered = coverage(boxes, np.concatenate([vehicles, truth.boxes[truth.ignored]]))
    owners = _owners(placings, len(boxes))
    alarms = suspicious & (owners < 0) & (covered <= _MOST_COVERED).all(axis=1)
    parts = np.zeros(len(boxes), np.bool_)
    for number, placing in enumerate(placings):
        own = owners == number
        others = np.delete(covered, number, axis=1)
        parts |= suspicious & placing.part & (others <= _MOST_COVERED).all(axis=1)
        for row in _some(placing.fits & own, settings.per_vehicle, rng):
            yield Choice("vehicle", _box(boxes[row]), _sides(placing.sides[row]))
        for row in _some(placing.shows & own, settings.per_vehicle, rng):
            yield Choice("box", _box(boxes[row]), _sides(placing.sides[row]))
    for row in _some(alarms, settings.false_alarms, rng):
        yield Choice("false alarm", _box(boxes[row]), None)
    for row in _some(parts, settings.parts, rng):
        yield Choice("part", _box(boxes[row]), None)


def scored_windows(
    boxes: npt.NDArray[np.int32], detections: Detections, frame_width: int
) -> Windows:
    """Return windows with the highest score of the detections that each fits; 0 where none fits.

    Parameters
    ----------
    boxes
        int32 `(n, 4)`: x, y, width, height of square windows, frame pixels.
    """
    scores = np.zeros(len(boxes), np.float32)
    squares = boxes.astype(np.float64)
    corners = detections.boxes.astype(np.float64)
    found = np.concatenate([corners[:, :2], corners[:, 2:] - corners[:, :2]], axis=1)
    for box, score in zip(found, detections.scores.tolist(), strict=True):
        fits = place(squares, box, frame_width).fits
        scores[fits] = np.maximum(scores[fits], score)
    return Windows(boxes, scores, np.ones_like(scores), boxes.astype(np.float32))


def _owners(placings: list[Placing], count: int) -> npt.NDArray[np.intp]:
    """Return the number of the vehicle nearest to each window, -1 if none is near."""
    distances = np.full((len(placings) + 1, count), np.inf)
    for number, placing in enumerate(placings, start=1):
        distances[number, placing.near] = placing.distances[placing.near]
    return np.asarray(distances.argmin(axis=0) - 1)


def _some(flags: BoolArray, most: int, rng: np.random.Generator) -> list[int]:
    """Return at most `most` of the flagged rows, at random, in order."""
    (rows,) = np.nonzero(flags)
    return sorted(rng.permutation(rows)[:most].tolist())


def _box(row: npt.NDArray[np.float64]) -> Box:
    x, y, width, height = (int(value) for value in row)
    return Box(x, y, width, height)


def _sides(row: npt.NDArray[np.float64]) -> Sides:
    left, top, right, bottom = (None if np.isnan(side) else float(side) for side in row)
    return left, top, right, bottom
