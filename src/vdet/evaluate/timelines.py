"""When each vehicle was found and by which track, and when it was missed or was a false alarm."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Literal

from vdet.evaluate.comparison import Comparison


@dataclass(frozen=True, slots=True)
class Stretch:
    """Consecutive frames in which a vehicle or a track has the same partner, or none.

    Attributes
    ----------
    kind
        `found` or `missed`: the vehicle `id` of the truth; `false alarm`: the track `id`.
    first, last
        Numbers of the frames, from 1.
    partner
        Id of the track that finds the vehicle; None of a mistake.
    overlap
        Mean over the frames of the best IoU with any box of the other side. Of a mistake, near 0:
        there is no such box. Below 0.5: the box fits badly. Above: the box is matched with another
        one.
    step
        Frames from one that is compared to the next.
    """

    kind: Literal["found", "missed", "false alarm"]
    id: int
    first: int
    last: int
    partner: int | None
    overlap: float
    step: int = 1

    @property
    def boxes(self) -> int:
        """Number of boxes."""
        return (self.last - self.first) // self.step + 1

    @property
    def name(self) -> str:
        """What the mistake is, as text."""
        missed = self.kind == "missed"
        return f"vehicle {self.id} missed" if missed else f"false alarm, track {self.id}"

    @property
    def span(self) -> str:
        """The first and the last frame, as text."""
        return f"{self.first}–{self.last}" if self.boxes > 1 else str(self.first)

    @property
    def middle(self) -> int:
        """Number of the middle frame."""
        return (self.first + self.last) // 2


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


def first_detections(comparison: Comparison) -> tuple[FirstDetection, ...]:
    """Return when each vehicle was first found, in the order of `vehicle_ids`."""
    appears: dict[int, int] = {}
    found: dict[int, int] = {}
    for frame in reversed(comparison.frames):  # so the first frame is the one that stays
        appears |= dict.fromkeys(frame.vehicles.tolist(), frame.number)
        found |= dict.fromkeys(frame.found.tolist(), frame.number)
    ids = enumerate(comparison.vehicle_ids.tolist())
    return tuple(FirstDetection(id_, appears[row], found.get(row)) for row, id_ in ids)


def frames_too_long(comparison: Comparison) -> tuple[int, ...]:
    """Return for how many frames each vehicle that was found is shown after its last true box.

    These are the frames in which its last track is a false alarm, until that track has a vehicle
    again. Vehicles are in the order of `vehicle_ids`.
    """
    tracks: dict[int, int] = {}  # the last one of each vehicle that was found
    extra: dict[int, int] = {}
    ended: set[int] = set()  # vehicles whose track has another vehicle
    for frame in comparison.frames:
        tracks |= zip(frame.found.tolist(), frame.found_by.tolist(), strict=True)
        there, shown = set(frame.vehicles.tolist()), set(frame.tracks.tolist())
        used = set(frame.found_by.tolist())
        for vehicle, track in tracks.items():
            if vehicle in there:
                extra[vehicle] = 0
                ended.discard(vehicle)
            elif track in used:
                ended.add(vehicle)
            elif track in shown and vehicle not in ended:
                extra[vehicle] += 1
    return tuple(extra[vehicle] for vehicle in sorted(extra))


def stretches(comparison: Comparison) -> tuple[Stretch, ...]:
    """Return when each vehicle was found or missed, and the false alarms, by vehicle and track.

    Frames in which a vehicle or a track does not count are in no stretch.
    """
    vehicles: dict[int, list[_Seen]] = {id_: [] for id_ in comparison.vehicle_ids.tolist()}
    alarms: dict[int, list[_Seen]] = {id_: [] for id_ in comparison.track_ids.tolist()}
    for frame in comparison.frames:
        ids = comparison.vehicle_ids[frame.vehicles].tolist()
        track_ids = comparison.track_ids[frame.tracks].tolist()
        pairs = zip(frame.rows.tolist(), frame.columns.tolist(), strict=True)
        partners = {ids[row]: track_ids[column] for row, column in pairs}
        for id_, overlap in zip(ids, frame.iou.max(axis=1, initial=0).tolist(), strict=True):
            vehicles[id_].append((frame.number, partners.get(id_), overlap))
        used = set(partners.values())
        for id_, overlap in zip(track_ids, frame.iou.max(axis=0, initial=0).tolist(), strict=True):
            if id_ not in used:
                alarms[id_].append((frame.number, None, overlap))
    step = comparison.step
    return *_stretches(vehicles, "missed", step), *_stretches(alarms, "false alarm", step)


_Seen = tuple[int, int | None, float]
"""A frame in which a vehicle or a track is, its partner there, and its best IoU."""


def _stretches(
    seen: Mapping[int, Sequence[_Seen]], mistake: Literal["missed", "false alarm"], step: int
) -> Iterator[Stretch]:
    for id_, boxes in seen.items():
        # Numbers of frames that follow one another are at one distance from their places.
        runs = groupby(enumerate(boxes), lambda each: (each[1][0] - step * each[0], each[1][1]))
        for (_, partner), run in runs:
            numbers, _, overlaps = zip(*(box for _, box in run), strict=True)
            kind = mistake if partner is None else "found"
            overlap = sum(overlaps) / len(overlaps)
            yield Stretch(kind, id_, numbers[0], numbers[-1], partner, overlap, step)


def mistakes(found: Sequence[Stretch]) -> tuple[Stretch, ...]:
    """Return the stretches without a partner, the longest first."""
    wrong = (each for each in found if each.partner is None)
    return tuple(sorted(wrong, key=lambda each: (-each.boxes, each.first, each.kind, each.id)))
