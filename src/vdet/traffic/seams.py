"""Which part of a video the next one shows again, by the vehicles in both.

Clocks say how long two videos overlap, but most have whole seconds. Vehicles that move say it to a
frame: the next video is laid over the end of the one before at each time that the clocks allow, and
where the vehicles of both are nearest, it begins.
"""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from vdet.boxes import Float64Array
from vdet.track.track import FrameTracks
from vdet.traffic.clock import SEAM

_MOVED = 0.2
"""Minimum distance that a vehicle moves to be compared, in heights of its box."""
_SAME = 0.5
"""Maximum mean distance of vehicles in an overlap, in heights. It is 0.8 to 1 for another camera,
and 0.2 to 0.4 where one of two runs finds the vehicles a second later.
"""
_SAMPLES = 8
"""Maximum number of moments that are compared."""
_STEP = 0.1
"""Minimum seconds between two frames that are not the same moment."""


@dataclass(frozen=True, slots=True)
class Overlap:
    """How long two videos overlap, seconds, and whether they show moving vehicles then."""

    seconds: float
    has_vehicles: bool


class MovingVehicles:
    """The vehicles that move in a part of a video.

    Parameters
    ----------
    frames
        The part; frames without a vehicle may be omitted.
    zero
        What is subtracted from their times, seconds.
    scale
        What pixels are multiplied by.

    Attributes
    ----------
    times
        Seconds of each frame since `zero`, ascending, `(n,)`.
    shown
        Those of frames with a vehicle that moves.
    """

    def __init__(self, frames: Iterable[FrameTracks], zero: float, scale: float = 1.0) -> None:
        rows, times = defaultdict[int, list[tuple[float, ...]]](list), []
        for number, frame in enumerate(frames):
            times.append(frame.time - zero)
            for track in frame.tracks:
                rows[track.id].append((number, *track.foot, track.box.height))
        vehicles = [np.array(row) for row in rows.values()]
        moving = [v for v in vehicles if np.ptp(v[:, 1:3], axis=0).max() >= _MOVED * v[:, 3].max()]
        every = np.concatenate([np.empty((0, 4)), *moving])
        every = every[every[:, 0].argsort(kind="stable")]
        self.times = np.array(times)
        self.shown = self.times[np.unique(every[:, 0]).astype(int)]
        starts = np.searchsorted(every[:, 0], np.arange(1, len(times)))
        self._by_frame = np.split(scale * every[:, 1:], starts)

    def at(self, time: float) -> Float64Array:
        """Return x and y of the feet and the heights in the frame at a time, pixels, `(k, 3)`."""
        nearest = int(np.abs(self.times - time).argmin())
        is_near = abs(self.times[nearest] - time) <= _STEP
        return self._by_frame[nearest] if is_near else np.empty((0, 3))


def find_overlap(before: MovingVehicles, after: MovingVehicles, by_clocks: float) -> Overlap | None:
    """Return how long two videos overlap; None if their vehicles differ whenever that may be.

    Parameters
    ----------
    before, after
        The end of a video, its times counted to its end, and the start of the next one.
    by_clocks
        Seconds of the overlap by the clocks; the true one is up to `SEAM` shorter or longer.
    """
    lengths = [*-before.times[np.abs(-before.times - by_clocks) <= SEAM], by_clocks]
    distances = {float(length): _distance(before, after, length) for length in lengths}
    same = {length: mean for length, mean in distances.items() if mean is not None}
    empty = [length for length in distances if length not in same]

    def off(length: float) -> float:
        return abs(length - by_clocks)

    best = min(same, key=lambda length: (round(same[length], 3), off(length)), default=0.0)
    is_same = same.get(best, 1.0) <= _SAME
    if is_same and (by_clocks > SEAM or _fits_better(before, after, same[best])):
        return Overlap(best, has_vehicles=True)
    return Overlap(min(empty, key=off), has_vehicles=False) if empty else None


def _distance(before: MovingVehicles, after: MovingVehicles, length: float) -> float | None:
    """Return the mean distance of vehicles in an overlap of a length; None without vehicles."""
    every = np.concatenate([before.shown + length, after.shown])
    every = np.unique(every[(every >= 0) & (every <= min(length, after.times[-1]))].round(3))
    if not len(every):
        return None
    chosen = every[np.unique(np.linspace(0, len(every) - 1, _SAMPLES).astype(int))]
    pairs = [_distances(before.at(time - length), after.at(time)) for time in chosen.tolist()]
    return float(np.concatenate(pairs).mean())


def _distances(first: Float64Array, second: Float64Array) -> Float64Array:
    """Return the distance of each vehicle to the nearest in the other frame, at most 1 height."""
    if not (len(first) and len(second)):
        return np.ones(len(first) + len(second))
    apart = np.hypot(*(first[:, np.newaxis, :2] - second[:, :2]).transpose(2, 0, 1))
    nearest = np.concatenate([apart.min(axis=1) / first[:, 2], apart.min(axis=0) / second[:, 2]])
    return np.asarray(nearest.clip(max=1))


def _fits_better(before: MovingVehicles, after: MovingVehicles, distance: float) -> bool:
    """Return whether vehicles are nearer in an overlap than if the next video began at the end."""
    at_end = _distances(before.at(float(before.times[-1])), after.at(float(after.times[0])))
    return not len(at_end) or float(at_end.mean()) > distance + _MOVED
