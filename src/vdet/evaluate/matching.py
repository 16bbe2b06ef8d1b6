"""Which prediction found which vehicle, frame by frame."""

from dataclasses import dataclass

import numpy as np

from vdet.boxes import Float64Array, Int64Array
from vdet.evaluate.comparison import MATCH_IOU, ComparedFrame, Comparison, assign, at_least

UNMATCHED = -1
"""Stands for the partner of a vehicle that no track has found."""

_KEEP_BONUS = 1000.0  # larger than any sum of overlaps


@dataclass(frozen=True, slots=True, eq=False)
class MatchedFrame:
    """A frame's pairs: row `vehicle_rows[i]` of its vehicles, row `track_rows[i]` of its tracks."""

    frame: ComparedFrame
    vehicle_rows: Int64Array
    track_rows: Int64Array

    def __len__(self) -> int:
        return len(self.vehicle_rows)

    @property
    def vehicles(self) -> Int64Array:
        """The vehicles that were found, int64: indices as in `ComparedFrame.vehicles`."""
        return self.frame.vehicles[self.vehicle_rows]

    @property
    def tracks(self) -> Int64Array:
        """The track that found each of `vehicles`, int64."""
        return self.frame.tracks[self.track_rows]

    @property
    def iou(self) -> Float64Array:
        """The overlap of each pair, float64."""
        return self.frame.iou[self.vehicle_rows, self.track_rows]


def match(comparison: Comparison) -> list[MatchedFrame]:
    """Pair vehicles with predictions in every frame, at IoU 0.5 and above.

    A pair of the previous frame stays together if it still overlaps enough; the others are paired
    so that the sum of IoU is largest. As in TrackEval, a frame without vehicles or without
    predictions does not count as the previous frame.
    Source: Bernardin and Stiefelhagen, "Evaluating Multiple Object Tracking Performance: The CLEAR
    MOT Metrics", 2008.
    """
    partners = np.full(len(comparison.vehicle_ids), UNMATCHED)
    matched = []
    for frame in comparison.frames:
        pairs = _match_frame(frame, partners)
        matched.append(pairs)
        if frame.iou.size:
            partners[:] = UNMATCHED
            partners[pairs.vehicles] = pairs.tracks
    return matched


def _match_frame(frame: ComparedFrame, partners: Int64Array) -> MatchedFrame:
    together = partners[frame.vehicles][:, np.newaxis] == frame.tracks[np.newaxis, :]
    weights = np.where(at_least(frame.iou, MATCH_IOU), frame.iou + _KEEP_BONUS * together, 0)
    return MatchedFrame(frame, *assign(weights))
