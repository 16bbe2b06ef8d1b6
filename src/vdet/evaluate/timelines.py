"""When each vehicle was found and by which track, and when it was missed or was a false alarm."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from vdet.boxes import Int64Array
from vdet.evaluate.comparison import ComparedFrame, Comparison


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
    for frame in comparison.frames:
        for vehicles, first in ((frame.vehicles, appears), (frame.found, found)):
            for vehicle in vehicles.tolist():
                first.setdefault(vehicle, frame.number)
    ids = enumerate(comparison.vehicle_ids.tolist())
    return tuple(FirstDetection(id_, appears[row], found.get(row)) for row, id_ in ids)


def frames_too_long(comparison: Comparison) -> tuple[int, ...]:
    """Return for how many frames each vehicle that was found is shown after its last true box.

    These are the frames in which its last track is a false alarm, until that track has a vehicle
    again. Vehicles are in the order of `vehicle_ids`.
    """
    last: dict[int, int] = {}
    last_track: dict[int, int] = {}
    for frame in comparison.frames:
        last.update(dict.fromkeys(frame.vehicles.tolist(), frame.number))
        last_track.update(zip(frame.found.tolist(), frame.found_by.tolist(), strict=True))
    extra = dict.fromkeys(last_track, 0)
    gone = dict(last_track)
    for frame in comparison.frames:
        shown, used = set(frame.tracks.tolist()), set(frame.found_by.tolist())
        for vehicle, track in list(gone.items()):
            if frame.number > last[vehicle]:
                extra[vehicle] += track in shown - used
                if track in used:
                    del gone[vehicle]
    return tuple(extra[vehicle] for vehicle in sorted(extra))


def stretches(comparison: Comparison) -> tuple[Stretch, ...]:
    """Return when each vehicle was found or missed, and the false alarms, by vehicle and track.

    Frames in which a vehicle or a track does not count are in no stretch.
    """
    ids = comparison.vehicle_ids, comparison.track_ids
    step = comparison.step
    of_vehicles = _stretches(comparison.frames, *ids, step)
    of_tracks = _stretches([_swapped(frame) for frame in comparison.frames], *ids[::-1], step)
    alarms = [replace(each, kind="false alarm") for each in of_tracks if each.partner is None]
    return *of_vehicles, *alarms


def _swapped(frame: ComparedFrame) -> ComparedFrame:
    """Return a frame with its tracks as vehicles."""
    swapped = replace(frame, vehicles=frame.tracks, tracks=frame.vehicles, iou=frame.iou.T)
    return replace(swapped, rows=frame.columns, columns=frame.rows)


def _stretches(
    frames: Sequence[ComparedFrame], ids: Int64Array, others: Int64Array, step: int
) -> list[Stretch]:
    seen: list[list[tuple[int, int | None, float]]] = [[] for _ in ids]
    for frame in frames:
        partners = dict(zip(frame.found.tolist(), others[frame.found_by].tolist(), strict=True))
        overlaps = frame.iou.max(axis=1, initial=0).tolist()
        for vehicle, overlap in zip(frame.vehicles.tolist(), overlaps, strict=True):
            seen[vehicle].append((frame.number, partners.get(vehicle), overlap))
    found: list[Stretch] = []
    for id_, each in zip(ids.tolist(), seen, strict=True):
        runs: list[list[tuple[int, int | None, float]]] = []
        for number, partner, overlap in each:
            if not runs or runs[-1][-1][:2] != (number - step, partner):
                runs.append([])
            runs[-1].append((number, partner, overlap))
        for run in runs:
            (first, partner, _), (last, *_) = run[0], run[-1]
            mean = sum(overlap for *_, overlap in run) / len(run)
            kind: Literal["found", "missed"] = "missed" if partner is None else "found"
            found.append(Stretch(kind, id_, first, last, partner, mean, step))
    return found


def mistakes(found: Sequence[Stretch]) -> tuple[Stretch, ...]:
    """Return the stretches without a partner, the longest first."""
    wrong = (each for each in found if each.partner is None)
    return tuple(sorted(wrong, key=lambda each: (-each.boxes, each.first, each.kind, each.id)))
