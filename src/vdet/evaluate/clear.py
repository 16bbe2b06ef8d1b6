"""CLEAR-MOT: how well vehicles are followed, mistake by mistake.

Source: Bernardin and Stiefelhagen, "Evaluating Multiple Object Tracking Performance: The CLEAR MOT
Metrics", 2008; details as in TrackEval.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vdet.evaluate.comparison import Comparison, counts
from vdet.evaluate.matching import MatchedFrame
from vdet.evaluate.ratio import ratio

_MOSTLY = 0.8
_HARDLY = 0.2
_NOBODY = -1


@dataclass(frozen=True, slots=True)
class Clear:
    """The CLEAR-MOT metrics.

    Attributes
    ----------
    mota
        1 - (misses + false positives + id switches) / true boxes; below 0 where mistakes prevail.
    motp
        Mean IoU of the matches: larger is better.
    id_switches
        Matches of a vehicle by another track than its last match, however long ago.
    fragmentations
        Times that a vehicle is found again after it was missed or away. As in TrackEval, frames
        with no prediction at all are passed over: a gap made of these only is none.
    mostly_tracked, partly_tracked, mostly_lost
        Vehicles found in more than 80 %, in 20 to 80 %, in less than 20 % of their boxes.
    """

    mota: float
    motp: float
    id_switches: int
    fragmentations: int
    mostly_tracked: int
    partly_tracked: int
    mostly_lost: int


def clear(comparison: Comparison, matched: Sequence[MatchedFrame]) -> Clear:
    """Return the CLEAR-MOT metrics; `matched` is `match(comparison)`."""
    vehicles = comparison.vehicle_lengths()
    matches = sum(len(frame) for frame in matched)
    false_positives = int(comparison.track_lengths().sum()) - matches
    switches = _id_switches(comparison, matched)
    found = counts((frame.vehicles for frame in matched), len(vehicles)) / vehicles
    return Clear(
        mota=ratio(matches - false_positives - switches, int(vehicles.sum())),
        motp=ratio(sum(float(frame.iou.sum()) for frame in matched), matches),
        id_switches=switches,
        fragmentations=_fragmentations(comparison, matched),
        mostly_tracked=int(np.sum(found > _MOSTLY)),
        partly_tracked=int(np.sum((found >= _HARDLY) & (found <= _MOSTLY))),
        mostly_lost=int(np.sum(found < _HARDLY)),
    )


def _id_switches(comparison: Comparison, matched: Sequence[MatchedFrame]) -> int:
    last = np.full(len(comparison.vehicle_ids), _NOBODY)
    switches = 0
    for frame in matched:
        before = last[frame.vehicles]
        switches += int(np.sum((before != _NOBODY) & (before != frame.tracks)))
        last[frame.vehicles] = frame.tracks
    return switches


def _fragmentations(comparison: Comparison, matched: Sequence[MatchedFrame]) -> int:
    before = np.zeros(len(comparison.vehicle_ids), np.bool_)
    starts = np.zeros(len(comparison.vehicle_ids), np.int64)
    for frame in matched:
        if not frame.frame.iou.size:
            continue
        now = np.zeros_like(before)
        now[frame.vehicles] = True
        starts += now & ~before
        before = now
    return int(np.maximum(starts - 1, 0).sum())
