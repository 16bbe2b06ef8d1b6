"""The paths of vehicles, and where they cross lines and the borders of zones.

Tracks are linked to the paths of vehicles (rule 8 of `vdet.traffic`). Lines and zones lie in pixels
of the frames, and the crossings of a border follow from a whole path.
"""

import math
from array import array
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from struct import Struct

import numpy as np

from vdet.boxes import EDGE, BoolArray, Box, Float64Array, cut_sides, has_moved
from vdet.config.scene import ZONE_DIRECTIONS, TrafficSettings
from vdet.polygons import Point, Segment, meeting, side_of, sides
from vdet.track.track import FrameTracks, Track

MAX_GAP = 1.0
"""Maximum seconds between the end of a track and the start of the one that continues it."""
DURATION_DIGITS = 4
"""Decimals to which durations are rounded before they are compared, because times are rounded."""

_KEEP_SECONDS = 10.0
"""Seconds for which a vehicle out of sight is kept; trackers keep ids for less."""
_HIDDEN_SECONDS, _DECISION_SECONDS = 0.5, 1.0
"""A track that was not shown for the first may be another vehicle, which the second decides."""
_TURN_HEIGHTS, _TURN_FRACTION = 0.15, 0.6
"""Distance backwards that makes it another vehicle: in heights of its box, and as a fraction of the
whole distance since it reappeared.
"""
_MAX_DISTANCE = 0.5
"""Maximum distance from the last or expected position of a lost vehicle to the start of the track
that continues it, in heights of the larger box.
"""
_REACH, _ACCELERATION, _FIRST_SPEED = 4.0, 1.5, 20.0
"""What a vehicle can move in the image: heights of its box, these per second squared, and per
second before its velocity is known.
"""
_BEHIND = 2.0
"""Minimum distance behind a vehicle that leaves the frame to be another one, in heights."""
_MAX_GROWTH = 2.0
"""Maximum ratio of the heights of the last box of a track and the first one of the next."""
_EXTRAPOLATED = 0.2, 0.3
"""Seconds after its last position at which a lost vehicle gets another; two settle a crossing."""
_LEAVING_SPEED = 0.1
"""Minimum speed of a vehicle that leaves the frame or turns, in heights of its box per second."""
_VELOCITY_ROWS = 20
"""Number of rows that give the velocity; each step has half the weight of the next."""
_PARKED_ROWS, _PARKED_EXTENT = 250, 0.05
"""Of so many rows within this fraction of the box height only the first and last are kept, so that
parked vehicles need no memory.
"""
_COLUMNS = 10
"""Numbers stored for a frame: time, x and y of the ground point, x1 and y1 of the box, score,
number of the frame, key of the track, x2 and y2 of the box.
"""
_ROW = Struct(f"{_COLUMNS}d")

ENTER, EXIT, APPEAR, VANISH = ZONE_DIRECTIONS

_INSIDE = 0.01
"""Points outside the frame are moved this far inside, pixels."""
_SETTLED = 0.1
"""Seconds outside the band of a border after which a vehicle has settled on a side."""
_BAND = 0.05
"""Distance from a border within which a vehicle is on neither side, in heights of its box."""
_MIN_BAND = 0.003
"""Minimum of this distance, as a fraction of the frame's height."""

_Size = tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class VehiclePath:
    """The positions of a vehicle, from all its tracks; a row for each frame that shows it.

    Attributes
    ----------
    vehicle
        Its number.
    class_name
        The last class of its track; of several tracks, of the one that shows it largest.
    seen
        Number of frames that show it. Later rows are extrapolated.
    times
        float64 `(n,)`, as are the other columns; seconds.
    points
        Ground points, pixels, `(n, 2)`.
    heights
        Heights of its box, pixels.
    scores, frames, ids
        Scores and ids of its tracks, and numbers of the frames. Of a later video, ids are larger by
        what `TrackLinker.start_video` returned.
    size
        Maximum of the mean of width and height of its box, pixels.
    """

    vehicle: int
    class_name: str | None
    seen: int
    times: Float64Array
    points: Float64Array
    heights: Float64Array
    scores: Float64Array
    frames: Float64Array
    ids: Float64Array
    size: float

    @property
    def has_moved(self) -> bool:
        """Whether it moved while it was seen, and did not stand the whole time."""
        return path_moves(self.points[: self.seen], self.size)

    @property
    def seconds(self) -> float:
        """From when it was first seen to when it was last seen."""
        return round(float(self.times[self.seen - 1] - self.times[0]), DURATION_DIGITS)


def path_moves(points: Float64Array, size: float) -> bool:
    """Return whether a vehicle of a size has moved at one of the points `(n, 2)` of its path."""
    return has_moved(float(np.hypot(*(points - points[0]).T).max()), size, surely=True)


def link_tracks(frames: Iterable[FrameTracks], width: int, height: int) -> list[VehiclePath]:
    """Return the path of each vehicle; `width` and `height` are the size of the frames, pixels."""
    linker = TrackLinker(width, height)
    ended = [path for frame in frames for path in linker.add(frame)]
    return [*ended, *linker.open_paths()]


class TrackLinker:
    """Links tracks to paths from frame to frame.

    Attributes
    ----------
    started
        Number of vehicles so far, including those of another linker whose numbers it continues.
    """

    def __init__(self, width: int, height: int, started: int = 0) -> None:
        self.started = started
        self._size = width, height
        self._now = -math.inf
        self._vehicles: dict[int, _Vehicle] = {}  # by the id of the track, and its video
        self._id_shift, self._largest = 0, -1  # of all ids

    def add(self, frame: FrameTracks) -> list[VehiclePath]:
        """Add the next frame; return the paths that have ended."""
        self._now = round(frame.time, 6)  # as in files
        oldest = self._now - (0 if frame.is_cut else _KEEP_SECONDS)
        ended = [key for key, vehicle in self._vehicles.items() if vehicle.last_seen < oldest]
        paths = [self._vehicles.pop(key).path(self._now) for key in ended]
        tracks = {track.id + self._id_shift: track for track in frame.tracks}
        lost = {} if tracks.keys() <= self._vehicles.keys() else self._lost(tracks)
        for key, track in tracks.items():
            vehicle, foot = self._vehicles.get(key), track.foot
            is_far = vehicle and math.dist(foot, vehicle.foot) > vehicle.box.height
            if vehicle and is_far and vehicle.is_jump(track, self._now, *self._size):
                self._vehicles[-vehicle.number] = self._vehicles.pop(key)
                vehicle = None
            vehicle = vehicle or self._begin(key, track, lost)
            vehicle.add(key, track, foot, self._now, frame.index)
            if vehicle.returned is not None and vehicle.has_turned():
                self.started += 1
                self._vehicles[key] = second = vehicle.split(self.started)
                paths.append(vehicle.path(self._now))
                vehicle = second
            vehicle.classes[key] = track.class_name
        return paths

    def start_video(self) -> int:
        """Treat the ids of the next frames as other tracks, because they are of another video.

        Returns what ids in paths are larger by.
        """
        self._id_shift = self._largest + 1
        return self._id_shift

    def open_paths(self) -> list[VehiclePath]:
        """Return the paths so far of the vehicles that may be shown again."""
        return [vehicle.path(self._now) for vehicle in self._vehicles.values()]

    def _lost(self, shown: Container[int]) -> dict[int, list[Point]]:
        """Return the last and the expected position of each vehicle that was just lost, by key.

        Vehicles with a key in `shown` are not lost. Those that leave, or would now be outside the
        frame, are omitted: a vehicle that appears there is another one.
        """
        width, height = self._size
        lost: dict[int, list[Point]] = {}
        for key, vehicle in self._vehicles.items():
            is_old = self._now - vehicle.last_seen > MAX_GAP
            if key in shown or is_old or vehicle.is_leaving(width, height):
                continue
            points = [(x, y) for x, y in vehicle.extrapolated(self._now)[:, 1:3].tolist()]
            x, y = points[-1]
            if 0 <= x <= width and 0 <= y <= height:
                lost[key] = points
        return lost

    def _begin(self, key: int, track: Track, lost: Mapping[int, list[Point]]) -> "_Vehicle":
        """Return the nearest lost vehicle that the track continues, or a new one."""
        point, height = track.written_foot, track.box.xywh[3]
        distances = {}
        for old, points in lost.items():
            if old not in self._vehicles:  # another track continues it
                continue
            low, high = sorted((height, self._vehicles[old].box.xywh[3]))
            distance = min(math.dist(point, position) for position in points)
            if high <= _MAX_GROWTH * low and distance <= _MAX_DISTANCE * high:
                distances[old] = distance
        if distances:
            vehicle = self._vehicles.pop(min(distances, key=distances.__getitem__))
        else:
            self.started += 1
            vehicle = _Vehicle(self.started, track.box, track.foot, self._now)
        self._vehicles[key] = vehicle
        self._largest = max(self._largest, key)
        return vehicle


@dataclass(slots=True)
class _Vehicle:
    """A vehicle that may be shown again.

    Attributes
    ----------
    box, foot, last_seen
        Its last box and ground point, and the time of that frame, seconds.
    rows
        The numbers of all its frames, one frame after the other: see `_table`.
    classes
        The class so far of each track.
    size
        As in `VehiclePath`, of rows that were removed.
    returned
        Index in `rows` at which it reappeared, until `has_turned` is decided.
    """

    number: int
    box: Box
    foot: Point
    last_seen: float
    rows: "array[float]" = field(default_factory=lambda: array("d"))
    classes: dict[int, str | None] = field(default_factory=dict)
    size: float = 0.0
    returned: int | None = None

    def add(self, key: int, track: Track, foot: Point, time: float, frame: int) -> None:
        """Add the next frame that shows it."""
        if time - self.last_seen > _HIDDEN_SECONDS:
            self.returned = len(self.rows)
        self.box = box = track.box
        self.foot, self.last_seen, (x, y) = foot, time, foot
        row = _ROW.pack(time, x, y, box.x1, box.y1, track.score, frame, key, box.x2, box.y2)
        self.rows.frombytes(row)  # three times faster than `extend`
        if len(self.rows) % (_PARKED_ROWS * _COLUMNS) == 0 and self.returned is None:
            latest = _table(self.rows[-_PARKED_ROWS * _COLUMNS :])
            if np.ptp(latest[:, 1:3], axis=0).max() <= _PARKED_EXTENT * latest[-1, 4]:
                self.size = max(self.size, _max_size(latest))
                del self.rows[(1 - _PARKED_ROWS) * _COLUMNS : -_COLUMNS]

    def is_jump(self, track: Track, time: float, width: int, height: int) -> bool:
        """Return whether a box with its id is too far away to be of this vehicle."""
        moved = complex(*track.foot) - complex(*self.foot)
        size = max(self.box.height, track.box.height)
        if abs(moved) <= _BEHIND * size:
            return False
        velocity, seconds = _velocity(self.rows), time - self.last_seen
        if (moved * velocity.conjugate()).real < 0 and self.is_leaving(width, height):
            return True
        speed = 2 * abs(velocity) if len(self.rows) > _COLUMNS else _FIRST_SPEED * size
        return abs(moved) > (_REACH + _ACCELERATION * seconds**2) * size + speed * seconds

    def has_turned(self) -> bool:
        """Return whether it moves backwards since it reappeared, and so is another vehicle."""
        if self.returned is None or self.last_seen - self.rows[self.returned] < _DECISION_SECONDS:
            return False
        before = _velocity(self.rows[: self.returned])
        first, *_, last = _table(self.rows[self.returned :])
        moved, speed, height = complex(*(last - first)[1:3]), abs(before), last[4]
        onward = (moved * before.conjugate()).real / max(speed, 1e-9)
        backward = max(_TURN_HEIGHTS * height, _TURN_FRACTION * abs(moved))
        has_turned = bool(speed > _LEAVING_SPEED * height and onward < -backward)
        if not has_turned:
            self.returned = None
        return has_turned

    def split(self, number: int) -> "_Vehicle":
        """Move the rows since it reappeared to a new vehicle, and return that."""
        self.size = max(self.size, _max_size(_table(self.rows)))
        rows = self.rows[self.returned :]
        del self.rows[self.returned :]
        return _Vehicle(number, self.box, self.foot, self.last_seen, rows, size=self.size)

    def is_leaving(self, width: int, height: int) -> bool:
        """Return whether it is at the edge of the frame and moves outwards."""
        cut = cut_sides(self.box.pixels, (width, height))
        outward = complex(cut.right - cut.left, cut.bottom - cut.top)
        return (_velocity(self.rows) * outward.conjugate()).real > _LEAVING_SPEED * self.box.xywh[3]

    def extrapolated(self, *times: float) -> Float64Array:
        """Return its last row, and a row for each later time at constant velocity."""
        rows = np.repeat(_table(self.rows[-_COLUMNS:]), 1 + len(times), axis=0)
        rows[1:, 0] = times
        velocity = _velocity(self.rows)
        rows[:, 1:3] += (rows[:, :1] - rows[0, 0]) * (velocity.real, velocity.imag)
        return rows

    def path(self, now: float) -> VehiclePath:
        """Return its path; a lost vehicle that has moved continues for a moment."""
        rows = _table(self.rows)
        seen, last = len(rows), rows[-1]
        if now - last[0] > MAX_GAP and math.dist(last[1:3], rows[0, 1:3]) > last[4]:
            rows = np.concatenate([rows, self.extrapolated(*np.add(last[0], _EXTRAPOLATED))[1:]])
        heights, scores, frames, ids = rows[:, 4:].T
        largest = max(reversed(self.classes), key=lambda key: heights[ids == key].max(initial=0))
        return VehiclePath(
            vehicle=self.number,
            class_name=self.classes[largest],
            seen=seen,
            times=rows[:, 0],
            points=rows[:, 1:3],
            heights=heights,
            scores=scores,
            frames=frames,
            ids=ids,
            size=max(self.size, _max_size(rows)),
        )


def _table(rows: "array[float]") -> Float64Array:
    """Return times, ground points, widths and heights of boxes, scores, frames and ids: `(n, 8)`.

    They are rounded as in files of tracks, so that counts of saved tracks are the same.
    """
    table = np.array(rows).reshape(-1, _COLUMNS)
    table[:, 1:3] = np.rint(100 * table[:, 1:3]) / 100
    sizes = np.floor(table[:, 8:] + 0.5) - np.floor(table[:, 3:5] + 0.5)
    table[:, 3:5] = np.maximum(1, sizes)
    return table[:, :8]


def _max_size(table: Float64Array) -> float:
    """Return the maximum of the mean of width and height of a box, pixels."""
    return float(table[:, 3:5].mean(axis=1).max())


def _velocity(rows: "array[float]") -> complex:
    """Return the velocity at the end of a path, x and y in pixels per second."""
    steps = np.diff(_table(rows[-_VELOCITY_ROWS * _COLUMNS :])[:, :3], axis=0)
    steps = steps[steps[:, 0] > 0]
    if not len(steps):
        return 0j
    weights = 0.5 ** np.arange(len(steps), 0, -1)
    weights[0] *= 2
    return complex(*(weights @ (steps[:, 1:] / steps[:, :1])))


@dataclass(frozen=True, slots=True)
class Line:
    """A line; its positive side is the left, seen from `start` towards `end`.

    `directions` are the names of left and right. `start` and `end` as drawn, and `size`, width and
    height of the frame, are in pixels.
    """

    name: str
    directions: tuple[str, str]
    start: Point
    end: Point
    size: _Size

    @property
    def length(self) -> float:
        """Pixels."""
        return math.dist(self.start, self.end)

    @property
    def extended(self) -> Segment:
        """The line, extended where it ends at the edge of the frame: vehicles stand beyond it."""
        (ax, ay), (bx, by) = self.start, self.end
        factor = sum(self.size) / self.length
        dx, dy = factor * (bx - ax), factor * (by - ay)
        start, end = (self._is_at_edge(point) for point in (self.start, self.end))
        return (ax - start * dx, ay - start * dy), (bx + end * dx, by + end * dy)

    def _is_at_edge(self, point: Point) -> bool:
        return any(value in (0, length) for value, length in zip(point, self.size, strict=True))

    def distances(self, points: Float64Array) -> Float64Array:
        """Return how far points `(n, 2)` are from the line, positive on the left, `(n,)`.

        The line is infinite here.
        """
        x, y = points.T
        return np.asarray(side_of(self.end, self.start, (x, y)))

    def meeting(self, path: Segment) -> float | None:
        """Return the fraction at which a path that changes the side meets the line.

        It follows from the distances that also give the side, so that none is lost by rounding.
        None if the path passes beyond the ends of the line.
        """
        before, after = self.distances(np.array(path)).tolist()
        along = before / (before - after)
        (ax, ay), (bx, by) = path
        (cx, cy), (dx, dy) = self.extended
        x, y = ax + along * (bx - ax) - cx, ay + along * (by - ay) - cy
        across = (x * (dx - cx) + y * (dy - cy)) / ((dx - cx) ** 2 + (dy - cy) ** 2)
        return along if 0 <= across <= 1 else None


@dataclass(frozen=True, slots=True)
class Zone:
    """A polygon, whose positive side is the inside; it extends beyond the edge of the frame.

    `corners` and `size`, the width and height of the frame, are in pixels.
    """

    name: str
    corners: tuple[Point, ...]
    size: _Size

    directions = ZONE_DIRECTIONS

    @property
    def inner_sides(self) -> list[Segment]:
        """The sides that do not run along the edge of the frame."""
        return [
            (a, b)
            for a, b in sides(self.corners)
            if not any(p == q and p in (0, end) for p, q, end in zip(a, b, self.size, strict=True))
        ]

    def distances(self, points: Float64Array) -> Float64Array:
        """Return how far points `(n, 2)` are from the sides, positive inside, `(n,)`.

        The distances are infinite if there are no sides.
        """
        points = self._in_frame(points)
        inside, border = _are_inside(self.corners, points), self.inner_sides
        if not border:
            return np.where(inside, np.inf, -np.inf)
        distances = distances_to(border, points).min(axis=1)
        return np.asarray(np.where(inside, distances, -distances))

    def meeting(self, path: Segment) -> float:
        """Return how far along `path` it last meets the border, 0 to 1."""
        (ax, ay), (bx, by) = self._in_frame(np.array(path)).tolist()
        fractions = (meeting(((ax, ay), (bx, by)), side) for side in self.inner_sides)
        return max((fraction for fraction in fractions if fraction is not None), default=1.0)

    def _in_frame(self, points: Float64Array) -> Float64Array:
        return np.clip(points, _INSIDE, np.array(self.size) - _INSIDE)


Border = Line | Zone
"""Its first direction leads to its positive side, its second to its negative side."""


def distances_to(segments: Sequence[Segment], points: Float64Array) -> Float64Array:
    """Return how far points `(n, 2)` are from the nearest points of segments `(m)`, `(n, m)`."""
    starts, ends = np.array(segments).swapaxes(0, 1)
    vectors, offsets = ends - starts, points[:, np.newaxis] - starts
    fractions = np.clip((offsets * vectors).sum(axis=2) / (vectors**2).sum(axis=1), 0, 1)
    return np.asarray(np.hypot(*np.moveaxis(offsets - fractions[..., np.newaxis] * vectors, 2, 0)))


def lines_near(lines: Sequence[Line], points: Float64Array, reach: Float64Array) -> Iterator[Line]:
    """Yield the lines that have one of the points `(n, 2)` within its reach, `(n,)`."""
    if lines:
        distances = distances_to([(line.start, line.end) for line in lines], points)
        are_near = (distances <= reach[:, np.newaxis]).T
        yield from (line for line, rows in zip(lines, are_near, strict=True) if rows.any())


def _are_inside(corners: Sequence[Point], points: Float64Array) -> BoolArray:
    """Return which points `(n, 2)` are inside a polygon; points on a side may be either.

    A point is inside if a ray from it meets an odd number of sides (Shimrat 1962).
    """
    x, y = points.T[..., np.newaxis]
    (ax, bx), (ay, by) = np.array(sides(corners)).T
    slopes = (bx - ax) / np.where(ay == by, 1, by - ay)
    met = ((ay > y) != (by > y)) & (x < ax + (y - ay) * slopes)
    return np.asarray(met.sum(axis=1) % 2 == 1)


def lines_and_zones(
    settings: TrafficSettings, width: int, height: int
) -> tuple[tuple[Line, ...], tuple[Zone, ...]]:
    """Return the lines and zones in frames of `width` × `height` pixels."""
    size, settings = (width, height), settings.for_frames(width, height)

    def in_frame(point: Point) -> Point:
        return _snapped(point[0], width), _snapped(point[1], height)

    lines = tuple(
        Line(line.name, (line.left, line.right), in_frame(line.start), in_frame(line.end), size)
        for line in settings.lines
    )
    zones = tuple(
        Zone(zone.name, tuple(map(in_frame, zone.points)), size) for zone in settings.zones
    )
    return lines, zones


def _snapped(value: float, length: float) -> float:
    """Return a coordinate, moved onto the edge of the frame if it is very near to it."""
    if value <= EDGE * length:
        return 0.0
    return float(length) if value >= length - EDGE * length else value


@dataclass(frozen=True, slots=True)
class Crossing:
    """A vehicle crosses a line, or enters, leaves, appears in or vanishes from a zone.

    Attributes
    ----------
    time
        Seconds, interpolated between two rows of the path.
    row
        Number of the first row of the path at or after it.
    direction
        As in `Event`.
    seconds
        How long the vehicle was in the zone, for exit and vanish; else None.
    """

    time: float
    row: int
    direction: str
    seconds: float | None = None


def crossings(path: VehiclePath, border: Border) -> list[Crossing]:
    """Return the crossings of a border by a vehicle, in order; a pure function."""
    changes = list(_changes(path, border))
    if not isinstance(border, Zone) or not changes:
        return changes
    visits = changes[:1]
    for entry, change in pairwise(changes):
        stay = change.time - entry.time if change.direction == EXIT else None
        visits.append(replace(change, seconds=stay))
    entry, last = changes[-1], path.seen - 1
    if entry.direction != EXIT:
        end = max(float(path.times[last]), entry.time)  # it may enter in extrapolated rows
        visits.append(Crossing(end, last, VANISH, end - entry.time))
    return visits


def _changes(path: VehiclePath, border: Border) -> Iterator[Crossing]:
    """Yield the changes of the settled side, and the start of a path inside a zone."""
    distances = border.distances(path.points)
    is_positive = distances >= 0
    turns = (np.flatnonzero(is_positive[1:] != is_positive[:-1]) + 1).tolist()
    if not turns and not (is_positive[0] and isinstance(border, Zone)):
        return  # as for most paths
    settles, is_clear = _settling(path, border, distances)
    side: bool | None = None  # the settled one; True: the positive one
    latest: Point | None = None  # of the latest crossing, unless it was beyond the line's ends
    for start, end in pairwise([0, *turns, len(is_positive)]):
        settled = start + np.flatnonzero(settles[start:end])
        if not len(settled) or side == is_positive[start]:
            continue
        if side is None:
            side = bool(is_positive[start])
            if side and isinstance(border, Zone):
                yield Crossing(float(path.times[0]), 0, APPEAR)
            continue
        # Where the path passes the border, between the row before and the first on this side.
        rows = slice(start - 1, start + 1)
        (ax, ay), (bx, by) = path.points[rows].tolist()
        before, after = path.times[rows].tolist()
        meets = border.meeting(((ax, ay), (bx, by)))  # None: beyond the line's ends
        along = 1.0 if meets is None else meets
        point = ax + along * (bx - ax), ay + along * (by - ay)
        distance = math.dist(latest, point) if latest else math.inf
        if is_clear[settled].any() or path.heights[settled].min() <= distance:
            side, latest = not side, None  # else it is still near the latest crossing
            if meets is not None:
                latest, direction = point, border.directions[0 if side else 1]
                row = start if along else start - 1
                yield Crossing(before + along * (after - before), row, direction)


def _settling(
    path: VehiclePath, border: Border, distances: Float64Array
) -> tuple[BoolArray, BoolArray]:
    """Return the rows in which a vehicle settles on its side, and those in which that is clear.

    It is clear if this row or the previous one is one box height away from the border. Otherwise
    the vehicle settles after some time outside the band.
    """
    is_positive, away, times = distances >= 0, np.abs(distances), path.times
    is_outside = away > np.maximum(_BAND * path.heights, _MIN_BAND * border.size[1])
    is_far = is_outside & (away >= path.heights)
    stays = is_positive[1:] == is_positive[:-1]
    was_far = np.append(False, is_far[:-1] & stays)
    begins = np.append(True, ~(is_outside[1:] & is_outside[:-1] & stays))
    since = times[np.maximum.accumulate(np.where(begins, np.arange(len(times)), 0))]
    settles = was_far | (is_outside & (np.round(times - since, DURATION_DIGITS) >= _SETTLED))
    settles[-1] |= is_far[-1]
    return settles, is_far | was_far
