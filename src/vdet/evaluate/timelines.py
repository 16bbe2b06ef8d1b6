"""When each true vehicle was found, by which track, and when it was missed."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from vdet.evaluate.comparison import Comparison
from vdet.evaluate.matching import MatchedFrame


@dataclass(frozen=True, slots=True)
class Stretch:
    """Consecutive frames, `first` to `last` from 1, found by one `track`; None: not found."""

    first: int
    last: int
    track: int | None


@dataclass(frozen=True, slots=True)
class Timeline:
    """The stretches of a vehicle in order; frames in which it does not count are in none.

    `switches` are the frames in which another track found it than the last time.
    """

    vehicle: int
    stretches: tuple[Stretch, ...]
    switches: tuple[int, ...]


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


def timelines(comparison: Comparison, matched: Sequence[MatchedFrame]) -> list[Timeline]:
    """Return the timeline of every vehicle, in order of index; `matched` is `match(comparison)`."""
    seen: list[dict[int, int | None]] = [{} for _ in comparison.vehicle_ids]
    for pairs in matched:
        for vehicle in pairs.frame.vehicles.tolist():
            seen[vehicle][pairs.frame.number] = None
        tracks = comparison.track_ids[pairs.tracks].tolist()
        for vehicle, track in zip(pairs.vehicles.tolist(), tracks, strict=True):
            seen[vehicle][pairs.frame.number] = track
    return [
        Timeline(vehicle, _stretches(frames), _switches(frames))
        for vehicle, frames in zip(comparison.vehicle_ids.tolist(), seen, strict=True)
    ]


def first_detections(found: Sequence[Timeline]) -> tuple[FirstDetection, ...]:
    """Return when the vehicle of each timeline was first found."""
    return tuple(
        FirstDetection(
            timeline.vehicle,
            timeline.stretches[0].first,
            next((each.first for each in timeline.stretches if each.track is not None), None),
        )
        for timeline in found
    )


def _stretches(frames: dict[int, int | None]) -> tuple[Stretch, ...]:
    found: list[Stretch] = []
    for number, track in frames.items():
        if found and found[-1].last == number - 1 and found[-1].track == track:
            found[-1] = Stretch(found[-1].first, number, track)
        else:
            found.append(Stretch(number, number, track))
    return tuple(found)


def _switches(frames: dict[int, int | None]) -> tuple[int, ...]:
    finds = [(number, track) for number, track in frames.items() if track is not None]
    return tuple(number for (_, before), (number, now) in pairwise(finds) if now != before)
