"""From tracks to paths: which tracks one vehicle has, and where it was in each frame.

Rule 8 of `vdet.traffic` is here.
"""

import math
from array import array
from collections.abc import Container, Iterable
from dataclasses import dataclass, field
from operator import itemgetter
from struct import Struct

import numpy as np

from vdet.boxes import Box, Float64Array
from vdet.track.track import FrameTracks, Track

GAP = 1.0
"""Longest time between the end of a track and the start of one that continues it, seconds."""
REMEMBERED = 10.0
"""Seconds for which a vehicle that is not shown is remembered; trackers keep ids for less."""
_MOVED = 0.5
"""Distance by which a vehicle that drives has moved, as a multiple of its size."""
DURATION_DIGITS = 4
"""Decimals of a duration in seconds that are compared: times are rounded."""

_LEAVES = 0.1
"""Lowest speed of a vehicle that leaves the frame, in heights of its box per second."""
_OUT_OF_SIGHT = 0.5
"""Seconds that a vehicle is not shown before it is looked at whether it is the same one."""
_JUDGED = 1.0
"""Seconds after which that is clear."""
_TURNED, _OPPOSITE = 0.15, 0.6
"""Way back after which it is another one: in heights of its box, and as a fraction of all its way.
"""
_REACH = 0.5
"""Farthest that the next track begins from where the last one ended or would be, in heights."""
_MAX_GROWTH = 2.0
"""Largest ratio of the heights of the last box of a track and the first one of the next."""
_ONWARD = 0.2, 0.3
"""Seconds after which a lost vehicle is taken to have driven on; two places settle a crossing."""
_LATEST = 20
"""Number of places that its velocity follows from; each step counts half as much as the next."""
_COLUMNS = 10
"""Numbers that are kept of a frame: time, x and y of the foot, x1 and y1 of the box, score, the
number of the frame, the id of the track, x2 and y2 of the box.
"""
_ROW = Struct(f"{_COLUMNS}d")
_STAY, _STANDS = 250, 0.05
"""Number of places of which only the first and the last are kept where a vehicle stands: where all
lie within this fraction of the height of its box. So memory does not grow with parked vehicles.
"""


_Lost = tuple[int, float, float, float]
"""The key of a vehicle that is lost, x and y of a foot, and the height of its box, pixels."""


@dataclass(frozen=True, slots=True, eq=False)
class VehiclePath:
    """Where a vehicle was, from all its tracks; a row for each frame that shows it.

    Attributes
    ----------
    vehicle
        Its number.
    class_name
        The last class of its track; of several tracks, of the one that shows it largest.
    tracks
        From when it had which track: times and ids.
    seen
        Number of frames that show it. Rows after these are where it would have driven on.
    times
        Seconds, `(n,)`, as are the others.
    points
        Feet, pixels, `(n, 2)`.
    heights
        Of its box, pixels.
    scores, frames
        Scores of its tracks, and numbers of the frames.
    size
        Largest mean of the width and the height of its box, pixels.
    """

    vehicle: int
    class_name: str | None
    tracks: tuple[tuple[float, int], ...]
    seen: int
    times: Float64Array
    points: Float64Array
    heights: Float64Array
    scores: Float64Array
    frames: Float64Array
    size: float

    @property
    def has_driven(self) -> bool:
        """Whether it moved while it was seen, and did not stand the whole time."""
        return has_moved(self.points[: self.seen], self.size)

    @property
    def seconds(self) -> float:
        """From when it was first seen to when it was last seen."""
        return round(float(self.times[self.seen - 1] - self.times[0]), DURATION_DIGITS)

    def track_at(self, row: int) -> int:
        """Return the id of its track in a row."""
        return next(key for since, key in reversed(self.tracks) if since <= self.times[row])


def has_moved(points: Float64Array, size: float) -> bool:
    """Return whether what is at points `(n, 2)` was ever half its size, pixels, from the first."""
    return bool(np.hypot(*(points - points[0]).T).max() >= _MOVED * size)


def link_tracks(frames: Iterable[FrameTracks], width: int, height: int) -> list[VehiclePath]:
    """Return the path of each vehicle; `width` and `height` are the size of the frames, pixels."""
    linker = TrackLinker(width, height)
    ended = [path for frame in frames for path in linker.add(frame)]
    return [*ended, *linker.open_paths()]


class TrackLinker:
    """Links tracks to paths from frame to frame.

    Attributes
    ----------
    begun
        How many vehicles have begun. The numbers of vehicles go on from that of another linker.
    """

    def __init__(self, width: int, height: int, begun: int = 0) -> None:
        self.begun = begun
        self._size = width, height
        self._now = -math.inf
        self._vehicles: dict[int, _Vehicle] = {}  # by the id of the track

    def add(self, frame: FrameTracks) -> list[VehiclePath]:
        """Add the next frame; return the paths that have ended."""
        self._now = round(frame.time, 6)  # as files hold it
        oldest = self._now - REMEMBERED
        ended = [key for key, vehicle in self._vehicles.items() if vehicle.shown < oldest]
        paths = [self._vehicles.pop(key).path(self._now) for key in ended]
        shown = {track.id for track in frame.tracks}
        lost = [] if shown <= self._vehicles.keys() else self._lost(shown)
        for track in frame.tracks:
            vehicle = self._vehicles.get(track.id) or self._begin(track, lost)
            vehicle.see(track, self._now, frame.index)
            if vehicle.is_another():
                paths.append(self._split(track.id))
            self._vehicles[track.id].classes[track.id] = track.class_name
        return paths

    def start_video(self) -> None:
        """Take the ids of the next frames for those of other tracks: they are of another video."""
        self._vehicles = {-vehicle.number: vehicle for vehicle in self._vehicles.values()}

    def open_paths(self) -> list[VehiclePath]:
        """Return the paths so far of the vehicles that may still be shown again."""
        return [vehicle.path(self._now) for vehicle in self._vehicles.values()]

    def _lost(self, shown: Container[int]) -> list[_Lost]:
        """Return the vehicles that may go on under a new id: they just disappeared in the frame.

        Those with a key in `shown` go on anyway. One that would be outside the frame now has left:
        a vehicle that appears there is another one. Each has two rows, for the place where it was
        last and for that where it would be now.
        """
        width, height = self._size
        lost: list[_Lost] = []
        for key, vehicle in self._vehicles.items():
            is_old = self._now - vehicle.shown > GAP
            if key in shown or is_old or vehicle.is_leaving(width, height):
                continue
            before, now = vehicle.onward(self._now)[:, [1, 2, 4]].tolist()
            if 0 <= now[0] <= width and 0 <= now[1] <= height:
                lost += [(key, *before), (key, *now)]
        return lost

    def _begin(self, track: Track, lost: Iterable[_Lost]) -> "_Vehicle":
        """Remember a new vehicle, or the nearest of the lost ones that goes on as this track."""
        foot, (*_, height) = track.written_foot, track.box.xywh
        near: list[tuple[float, int]] = []
        for key, x, y, other in lost:
            distance, larger = math.dist(foot, (x, y)), max(height, other)
            is_alike = larger <= _MAX_GROWTH * min(height, other)
            if key in self._vehicles and is_alike and distance <= _REACH * larger:  # not taken yet
                near.append((distance, key))
        if near:
            vehicle = self._vehicles.pop(min(near, key=itemgetter(0))[1])
        else:
            self.begun += 1
            vehicle = _Vehicle(self.begun, track.box, self._now)
        vehicle.tracks.append((self._now, track.id))
        self._vehicles[track.id] = vehicle
        return vehicle

    def _split(self, key: int) -> VehiclePath:
        """Return the path until a vehicle was out of sight; since then it is another one."""
        self.begun += 1
        vehicle = self._vehicles[key]
        vehicle.size = max(vehicle.size, _largest(_table(vehicle.rows)))
        tracks, rows = vehicle.tracks.copy(), vehicle.rows[vehicle.back or 0 :]
        other = _Vehicle(self.begun, vehicle.box, self._now, tracks, rows, size=vehicle.size)
        self._vehicles[key] = other
        del vehicle.rows[vehicle.back or 0 :]
        return vehicle.path(self._now)


@dataclass(slots=True)
class _Vehicle:
    """A vehicle that may still be shown again.

    Attributes
    ----------
    box, shown
        Its last box, and when it was shown, seconds.
    tracks
        Those of `VehiclePath`.
    rows
        All that was seen of it, one frame after the other: see `_table`.
    classes
        The class so far of each track.
    size
        That of `VehiclePath`, without `rows`.
    back
        Where in `rows` it came back after it was out of sight, until it is clear who that is.
    """

    number: int
    box: Box
    shown: float
    tracks: list[tuple[float, int]] = field(default_factory=list)
    rows: "array[float]" = field(default_factory=lambda: array("d"))
    classes: dict[int, str | None] = field(default_factory=dict)
    size: float = 0.0
    back: int | None = None

    def see(self, track: Track, time: float, frame: int) -> None:
        """Add the next frame that shows it."""
        if time - self.shown > _OUT_OF_SIGHT:
            self.back = len(self.rows)
        self.box = box = track.box
        self.shown, (x, y) = time, track.foot
        known = track.score, frame, track.id
        row = _ROW.pack(time, x, y, box.x1, box.y1, *known, box.x2, box.y2)
        self.rows.frombytes(row)  # three times faster than `extend`
        if len(self.rows) % (_STAY * _COLUMNS) == 0 and self.back is None:
            stay = _table(self.rows[-_STAY * _COLUMNS :])
            if np.ptp(stay[:, 1:3], axis=0).max() <= _STANDS * stay[-1, 4]:
                self.size = max(self.size, _largest(stay))
                del self.rows[(1 - _STAY) * _COLUMNS : -_COLUMNS]

    def is_another(self) -> bool:
        """Return whether it drives the other way than before it was out of sight."""
        if self.back is None or self.shown - self.rows[self.back] < _JUDGED:
            return False
        before = _velocity(self.rows[: self.back])
        first, *_, last = _table(self.rows[self.back :])
        way, speed, height = complex(*(last - first)[1:3]), abs(before), last[4]
        onward = (way * before.conjugate()).real / max(speed, 1e-9)
        is_another = speed > _LEAVES * height
        is_another &= onward < -max(_TURNED * height, _OPPOSITE * abs(way))
        if not is_another:
            self.back = None
        return bool(is_another)

    def is_leaving(self, width: int, height: int) -> bool:
        """Return whether it moves out at the edge of the frame, and so was not lost."""
        x1, y1, x2, y2 = self.box.pixels
        outward = complex((x2 >= width - 1) - (x1 <= 1), (y2 >= height - 1) - (y1 <= 1))
        return (_velocity(self.rows) * outward.conjugate()).real > _LEAVES * (y2 - y1)

    def onward(self, *times: float) -> Float64Array:
        """Return its last row, and those of later times if it moves on."""
        rows = np.repeat(_table(self.rows[-_COLUMNS:]), 1 + len(times), axis=0)
        rows[1:, 0] = times
        velocity = _velocity(self.rows)
        rows[:, 1:3] += (rows[:, :1] - rows[0, 0]) * (velocity.real, velocity.imag)
        return rows

    def path(self, now: float) -> VehiclePath:
        """Return its path; if it was lost, it drives on for a moment."""
        rows = _table(self.rows)
        seen, last = len(rows), rows[-1]
        if now - last[0] > GAP and math.dist(last[1:3], rows[0, 1:3]) > last[4]:
            rows = np.concatenate([rows, self.onward(*np.add(last[0], _ONWARD))[1:]])
        times, points, (heights, scores, frames, ids) = rows[:, 0], rows[:, 1:3], rows[:, 4:].T
        largest = max(reversed(self.classes), key=lambda key: heights[ids == key].max(initial=0))
        who = self.number, self.classes[largest], tuple(self.tracks), seen
        size = max(self.size, _largest(rows))
        return VehiclePath(*who, times, points, heights, scores, frames, size)


def _table(rows: "array[float]") -> Float64Array:
    """Return times, feet, widths and heights of boxes, scores, frames and ids: `(n, 8)`.

    They are as exact as files of tracks hold them, so that both count alike.
    """
    table = np.array(rows).reshape(-1, _COLUMNS)
    table[:, 1:3] = np.rint(100 * table[:, 1:3]) / 100
    sizes = np.floor(table[:, 8:] + 0.5) - np.floor(table[:, 3:5] + 0.5)
    table[:, 3:5] = np.maximum(1, sizes)
    return table[:, :8]


def _largest(table: Float64Array) -> float:
    """Return the largest mean of the width and the height of a box, pixels."""
    return float(table[:, 3:5].mean(axis=1).max())


def _velocity(rows: "array[float]") -> complex:
    """Return the velocity at the end of a path, x and y in pixels a second."""
    steps = np.diff(_table(rows[-_LATEST * _COLUMNS :])[:, :3], axis=0)
    steps = steps[steps[:, 0] > 0]
    if not len(steps):
        return 0j
    weights = 0.5 ** np.arange(len(steps), 0, -1)
    weights[0] *= 2
    return complex(*(weights @ (steps[:, 1:] / steps[:, :1])))
