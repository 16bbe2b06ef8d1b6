"""Where the boxes are lost: runs of frames in which a vehicle is missed or a track is wrong."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from vdet.evaluate.comparison import ComparedFrame, Comparison
from vdet.evaluate.labelled_video import Integers
from vdet.evaluate.matching import MatchedFrame
from vdet.geometry import Float64Array

Kind = Literal["missed", "false alarm"]


@dataclass(frozen=True, slots=True)
class Loss:
    """Consecutive frames with the same mistake.

    Attributes
    ----------
    kind
        `missed`: the vehicle `id` of the truth; `false alarm`: the track `id`.
    first, last
        Numbers of the frames, from 1.
    overlap
        Mean over the frames of the best IoU with any box of the other side: near 0 where there is
        none at all, below 0.5 where there is one that fits badly, above where that one is taken.
    """

    kind: Kind
    id: int
    first: int
    last: int
    overlap: float

    @property
    def boxes(self) -> int:
        """How many boxes were lost."""
        return self.last - self.first + 1

    @property
    def middle(self) -> int:
        """Number of the frame that stands for all of them."""
        return (self.first + self.last) // 2


@dataclass(frozen=True, slots=True)
class _Mistake:
    kind: Kind
    id: int
    frame: int
    overlap: float


def losses(comparison: Comparison, matched: Sequence[MatchedFrame]) -> list[Loss]:
    """Return the losses of one video, the largest first; `matched` is `match(comparison)`."""
    mistakes: list[_Mistake] = []
    for pairs in matched:
        frame = pairs.frame
        mistakes += _unpaired(
            "missed", frame, comparison.vehicle_ids[frame.vehicles], frame.iou, pairs.vehicle_rows
        )
        mistakes += _unpaired(
            "false alarm", frame, comparison.track_ids[frame.tracks], frame.iou.T, pairs.track_rows
        )
    found = [_loss(run) for run in _runs(mistakes)]
    return sorted(found, key=lambda loss: (-loss.boxes, loss.first, loss.kind, loss.id))


def _unpaired(
    kind: Kind, frame: ComparedFrame, ids: Integers, overlaps: Float64Array, paired: Integers
) -> Iterable[_Mistake]:
    for row in np.setdiff1d(np.arange(len(ids)), paired).tolist():
        yield _Mistake(kind, int(ids[row]), frame.number, float(overlaps[row].max(initial=0)))


def _runs(mistakes: Iterable[_Mistake]) -> Iterable[list[_Mistake]]:
    """Join mistakes of one kind and id in consecutive frames."""
    open_runs: dict[tuple[Kind, int], list[_Mistake]] = {}
    for mistake in mistakes:
        key = mistake.kind, mistake.id
        if key in open_runs and open_runs[key][-1].frame == mistake.frame - 1:
            open_runs[key].append(mistake)
            continue
        if key in open_runs:
            yield open_runs[key]
        open_runs[key] = [mistake]
    yield from open_runs.values()


def _loss(run: list[_Mistake]) -> Loss:
    overlap = sum(mistake.overlap for mistake in run) / len(run)
    return Loss(run[0].kind, run[0].id, run[0].frame, run[-1].frame, overlap)
