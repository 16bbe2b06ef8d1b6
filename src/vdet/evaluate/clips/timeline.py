"""Each true vehicle's story: when it was seen, by which track, and when it was missed."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from vdet.evaluate.comparison import Comparison
from vdet.evaluate.matching import MatchedFrame


@dataclass(frozen=True, slots=True)
class Stretch:
    """Consecutive frames, `first` to `last` from 1, in which `track` found it; None: nobody did."""

    first: int
    last: int
    track: int | None


@dataclass(frozen=True, slots=True)
class Timeline:
    """A vehicle's stretches in order; frames in which it does not count are in none.

    `switches` are the frames in which another track took over than had it last.
    """

    vehicle: int
    stretches: tuple[Stretch, ...]
    switches: tuple[int, ...]


def timelines(comparison: Comparison, matched: Sequence[MatchedFrame]) -> list[Timeline]:
    """Return the timeline of every vehicle of one video; `matched` is `match(comparison)`."""
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
