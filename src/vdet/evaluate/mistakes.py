"""Mistakes: runs of frames in which a vehicle is missed or a track is wrong."""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from vdet.boxes import Int64Array
from vdet.evaluate.comparison import Comparison
from vdet.evaluate.matching import MatchedFrame

MistakeKind = Literal["missed", "false alarm"]


@dataclass(frozen=True, slots=True)
class Mistake:
    """Consecutive frames with the same mistake.

    Attributes
    ----------
    kind
        `missed`: of the vehicle `id` of the truth; `false alarm`: of the track `id`.
    first, last
        Numbers of the frames, from 1.
    overlap
        Mean over the frames of the best IoU with any box of the other side. Near 0: there is no
        such box. Below 0.5: the box fits badly. Above: the box is matched with another one.
    """

    kind: MistakeKind
    id: int
    first: int
    last: int
    overlap: float

    @property
    def boxes(self) -> int:
        """Number of boxes lost."""
        return self.last - self.first + 1

    @property
    def middle(self) -> int:
        """Number of the middle frame."""
        return (self.first + self.last) // 2


_Misses = list[tuple[int, float]]
"""Number of the frame and best IoU of each mistake, in order."""


def mistakes(comparison: Comparison, matched: Sequence[MatchedFrame]) -> list[Mistake]:
    """Return the mistakes of one video, the longest first; `matched` is `match(comparison)`."""
    misses: dict[tuple[MistakeKind, int], _Misses] = defaultdict(list)
    for pairs in matched:
        frame = pairs.frame
        vehicle_ids = comparison.vehicle_ids[frame.vehicles]
        for row in _others(len(vehicle_ids), pairs.vehicle_rows):
            overlap = float(frame.iou[row].max(initial=0))
            misses["missed", int(vehicle_ids[row])].append((frame.number, overlap))
        track_ids = comparison.track_ids[frame.tracks]
        for row in _others(len(track_ids), pairs.track_rows):
            overlap = float(frame.iou[:, row].max(initial=0))
            misses["false alarm", int(track_ids[row])].append((frame.number, overlap))
    found = [
        Mistake(kind, id_, run[0][0], run[-1][0], sum(overlap for _, overlap in run) / len(run))
        for (kind, id_), each in misses.items()
        for run in _runs(each)
    ]
    return sorted(found, key=lambda each: (-each.boxes, each.first, each.kind, each.id))


def _others(count: int, rows: Int64Array) -> list[int]:
    """Return the rows 0 … `count` - 1 that are not in `rows`."""
    others: list[int] = np.setdiff1d(np.arange(count), rows).tolist()
    return others


def _runs(misses: _Misses) -> Iterable[_Misses]:
    """Split mistakes where their frames are not consecutive."""
    starts = [i for i in range(1, len(misses)) if misses[i][0] != misses[i - 1][0] + 1]
    for start, end in zip([0, *starts], [*starts, len(misses)], strict=True):
        yield misses[start:end]
