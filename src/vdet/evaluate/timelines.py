"""When each vehicle was found and by which track, and when vehicle and track have no partner."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from vdet.boxes import Float64Array, Int64Array
from vdet.evaluate.comparison import Comparison, MatchedFrame

MistakeKind = Literal["missed", "false alarm"]


@dataclass(frozen=True, slots=True)
class Stretch:
    """Consecutive frames, `first` to `last` from 1, with the same partner.

    `partner` is the id of the matched track or vehicle; None: there is no match. `overlap` is the
    mean over the frames of the best IoU with any box of the other side.
    """

    first: int
    last: int
    partner: int | None
    overlap: float


@dataclass(frozen=True, slots=True)
class Timeline:
    """The stretches of the vehicle or track `id`, in order.

    Frames in which it does not count are in no stretch.
    """

    id: int
    stretches: tuple[Stretch, ...]


@dataclass(frozen=True, slots=True)
class FirstDetection:
    """When a vehicle was first found.

    `vehicle` is its id in the truth, `appears` the first frame in which it counts, `found` the
    first frame in which it is matched (both from 1), None if it never is.
    """

    vehicle: int
    appears: int
    found: int | None

    @property
    def delay(self) -> int | None:
        """Frames from its appearance until it was found; None if it never was."""
        return None if self.found is None else self.found - self.appears


@dataclass(frozen=True, slots=True)
class Mistake:
    """Consecutive frames with the same mistake.

    Attributes
    ----------
    kind
        `missed`: the vehicle `id` of the truth; `false alarm`: the track `id`.
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


def vehicle_timelines(
    comparison: Comparison, matched: Sequence[MatchedFrame]
) -> tuple[Timeline, ...]:
    """Return the timeline of each vehicle, in order of index; `matched` is `match(comparison)`."""
    sides = (
        (each.frame.number, each.frame.vehicles, each.frame.iou, each.vehicles, each.tracks)
        for each in matched
    )
    return _timelines(comparison.vehicle_ids, comparison.track_ids, sides)


def track_timelines(
    comparison: Comparison, matched: Sequence[MatchedFrame]
) -> tuple[Timeline, ...]:
    """Return the timeline of each track, in order of index; `matched` is `match(comparison)`."""
    sides = (
        (each.frame.number, each.frame.tracks, each.frame.iou.T, each.tracks, each.vehicles)
        for each in matched
    )
    return _timelines(comparison.track_ids, comparison.vehicle_ids, sides)


def first_detections(vehicles: Sequence[Timeline]) -> tuple[FirstDetection, ...]:
    """Return when the vehicle of each timeline was first found."""
    return tuple(
        FirstDetection(
            vehicle.id,
            vehicle.stretches[0].first,
            next((each.first for each in vehicle.stretches if each.partner is not None), None),
        )
        for vehicle in vehicles
    )


def mistakes(vehicles: Sequence[Timeline], tracks: Sequence[Timeline]) -> tuple[Mistake, ...]:
    """Return the stretches without a partner, the longest first."""
    sides: tuple[tuple[MistakeKind, Sequence[Timeline]], ...]
    sides = ("missed", vehicles), ("false alarm", tracks)
    found = [
        Mistake(kind, timeline.id, each.first, each.last, each.overlap)
        for kind, timelines in sides
        for timeline in timelines
        for each in timeline.stretches
        if each.partner is None
    ]
    return tuple(sorted(found, key=lambda each: (-each.boxes, each.first, each.kind, each.id)))


_Seen = tuple[int, int | None, float]
"""Number of a frame, the id of the partner in it, and the best IoU."""


def _timelines(
    ids: Int64Array,
    other_ids: Int64Array,
    sides: Iterable[tuple[int, Int64Array, Float64Array, Int64Array, Int64Array]],
) -> tuple[Timeline, ...]:
    """Return the timelines of one side.

    For each frame, `sides` has its number, the indices in it, a row of IoU for each of these, the
    indices that are matched, and the indices of their partners.
    """
    seen: list[list[_Seen]] = [[] for _ in ids]
    for number, indices, iou, paired, partners in sides:
        partner_of = dict(zip(paired.tolist(), other_ids[partners].tolist(), strict=True))
        overlaps = iou.max(axis=1, initial=0).tolist()
        for index, overlap in zip(indices.tolist(), overlaps, strict=True):
            seen[index].append((number, partner_of.get(index), overlap))
    return tuple(
        Timeline(id_, _stretches(each)) for id_, each in zip(ids.tolist(), seen, strict=True)
    )


def _stretches(seen: Sequence[_Seen]) -> tuple[Stretch, ...]:
    runs: list[list[_Seen]] = []
    for number, partner, overlap in seen:
        if not runs or runs[-1][-1][:2] != (number - 1, partner):
            runs.append([])
        runs[-1].append((number, partner, overlap))
    return tuple(
        Stretch(run[0][0], run[-1][0], run[0][1], sum(each[2] for each in run) / len(run))
        for run in runs
    )
