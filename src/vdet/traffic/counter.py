"""The counter: from the tracks of each frame to events. `vdet.traffic` explains the rule."""

import math
from collections import Counter
from dataclasses import dataclass, field, replace

import numpy as np

from vdet.boxes import Box
from vdet.config.places import TrafficSettings
from vdet.detect.classes import ClassScores
from vdet.polygons import Point
from vdet.track.track import FrameTracks, Track
from vdet.traffic.borders import (
    APPEAR,
    BAND,
    LEAST_BAND,
    TIME_DIGITS,
    VANISH,
    Border,
    BorderState,
    Change,
    Sighting,
    Zone,
    place,
)
from vdet.traffic.checks import is_missed_at, line_warnings
from vdet.traffic.counts import Counts, Event

REMEMBERED = 10.0
"""Seconds for which a vehicle that is not shown is remembered; trackers keep ids for less."""

_GAP = 1.0
"""Longest time between the end of a track and the start of one that continues it, seconds."""
_LEAVES = 0.1
"""Lowest speed of a vehicle that leaves the frame, in heights of its box per second."""
_OUT_OF_SIGHT = 0.5
"""Seconds that a vehicle is not shown before it is looked at whether it is the same one."""
_JUDGED = 1.0
"""Seconds after which that is clear."""
_TURNED, _OPPOSITE = 0.15, 0.6
"""Way back after which it is another one: in heights of its box, and as a share of all its way."""
_REACH = 0.5
"""Farthest that the next track begins from where the last one ended or would be, in heights."""
_MOST_GROWTH = 2.0
"""Largest ratio of the heights of the last box of a track and the first one of the next."""
_ONWARD = 0.2, 0.3
"""Seconds after which a lost vehicle is taken to have driven on; two places settle a crossing."""


@dataclass(slots=True)
class _Vehicle:
    """The state of a vehicle.

    `id` is that of its latest track. `key` is the same while the video of that track lasts, and
    then another number. `events` are those that wait for the vehicle to be confirmed.
    """

    id: int
    key: int
    number: int
    first: Sighting
    last: Sighting
    states: list[BorderState]
    shown: float = 0.0  # when it was last shown, also by prediction
    velocity: complex = 0j  # x and y, pixels a second
    box: Box = field(init=False)
    clear: float = 0.0  # distance from `looked_at` within which nothing changes at any border
    looked_at: Point = (0.0, 0.0)
    classes: ClassScores = field(default_factory=ClassScores)
    events: list[Event] = field(default_factory=list)
    back: Sighting | None = None  # the first one after it was out of sight, until it is judged
    before: complex = 0j  # its velocity before that
    again: float = 0.0  # when it came back, once that is judged

    def is_another(self, sighting: Sighting) -> bool:
        """Return whether it drives the other way than before it was out of sight."""
        if sighting.time - self.last.time > _OUT_OF_SIGHT:
            self.back, self.before = sighting, self.velocity
        if self.back is None or sighting.time - self.back.time < _JUDGED:
            return False
        way, speed = complex(*sighting.point) - complex(*self.back.point), abs(self.before)
        self.again, self.back = self.back.time, None
        onward = (way * self.before.conjugate()).real / max(speed, 1e-9)
        back = max(_TURNED * sighting.height, _OPPOSITE * abs(way))
        return speed > _LEAVES * sighting.height and onward < -back

    def is_leaving(self, width: int, height: int) -> bool:
        """Return whether it moves out at the edge of the frame, and so was not lost."""
        x1, y1, x2, y2 = self.box.pixels
        outward = complex((x2 >= width - 1) - (x1 <= 1), (y2 >= height - 1) - (y1 <= 1))
        return (self.velocity * outward.conjugate()).real > _LEAVES * self.last.height

    def expected(self, time: float) -> Point:
        """Return where it would be now if it had moved on."""
        place = complex(*self.last.point) + self.velocity * (time - self.last.time)
        return place.real, place.imag

    def move(self, sighting: Sighting) -> None:
        """Move to the place of the next sighting."""
        last, self.last = self.last, sighting
        seconds = sighting.time - last.time
        if seconds > 0:
            (x, y), (last_x, last_y) = sighting.point, last.point
            change = complex(x - last_x, y - last_y) / seconds - self.velocity
            self.velocity += change if last is self.first else 0.5 * change

    def add(
        self, name: str, direction: str, at: Sighting | Change, seconds: float | None = None
    ) -> None:
        """Add an event."""
        time, score = round(at.time, 3), round(at.score, 4)
        stay = None if seconds is None else round(seconds, 3)
        event = Event(time, at.frame, name, direction, self.id, self.number, None, score, stay)
        self.events.append(event)


class _Ended:
    """Vehicles that may go on under a new id: those that have just ended inside the frame.

    One that would be outside it now has left: who comes in there is another. Each has two rows, for
    the place where it was last and for that where it would be now. They are ordered by x, so that a
    new vehicle is compared only with those near it.
    """

    def __init__(self, vehicles: list[_Vehicle], now: float, size: tuple[int, int]) -> None:
        rows = [
            (at, each)
            for each in vehicles
            for x, y in [each.expected(now)]
            if 0 <= x <= size[0] and 0 <= y <= size[1]
            for at in (each.last.point, (x, y))
        ]
        rows.sort(key=lambda row: row[0])
        self._vehicles = [each for _, each in rows]
        self._places = np.array([at for at, _ in rows], np.float64).reshape(-1, 2)
        self._heights = np.array([each.last.height for each in self._vehicles])
        self._taken: set[int] = set()

    def take(self, sighting: Sighting) -> _Vehicle | None:
        """Return the nearest vehicle that goes on at a place, each only once; None if none does."""
        reach = 1 + _REACH * _MOST_GROWTH * sighting.height
        first, last = np.searchsorted(
            self._places[:, 0], sighting.point[0] + np.array([-reach, reach])
        )
        heights = self._heights[first:last]
        larger, smaller = np.maximum(heights, sighting.height), np.minimum(heights, sighting.height)
        distances = np.hypot(*(self._places[first:last] - sighting.point).T)
        fits = np.flatnonzero((larger <= _MOST_GROWTH * smaller) & (distances <= _REACH * larger))
        near: list[tuple[float, int, int]] = [
            (distances[row], number, first + row)
            for row in fits.tolist()
            if (number := self._vehicles[first + row].number) not in self._taken
        ]
        if not near:
            return None
        _, number, nearest = min(near)
        self._taken.add(number)
        return self._vehicles[nearest]


class VehicleCounter:
    """Counts the vehicles of one video, or of several that follow one another.

    Attributes
    ----------
    lines, zones
        Places in its frames.
    begun
        How many vehicles have begun. The numbers of vehicles go on from that of another counter.

    Raises
    ------
    ConfigError
        They are given for frames of another aspect ratio than `width` × `height` pixels.
    """

    def __init__(self, settings: TrafficSettings, width: int, height: int, begun: int = 0) -> None:
        self.lines, self.zones = place(settings, width, height)
        self._confirmed = settings.confirmed
        self._borders: tuple[Border, ...] = (*self.lines, *self.zones)
        self._size = width, height
        self._vehicles: dict[int, _Vehicle] = {}
        self._counted: list[tuple[Event, ClassScores]] = []  # the class is known at the end
        self._tally: Counter[tuple[str, str]] = Counter()
        self.begun = begun
        self._first, self._now = math.inf, -math.inf
        self._is_used = False  # a vehicle was there
        self._missed: Counter[str] = Counter()  # tracks that begin or end at a line, by its name
        self._heights: dict[str, list[float]] = {line.name: [] for line in self.lines}

    def update(self, frame: FrameTracks) -> None:
        """Add the tracks of the next frame."""
        self._now = round(frame.time, 6)  # as files hold it
        self._first = min(self._first, self._now)
        oldest = self._now - REMEMBERED
        for vehicle in [each for each in self._vehicles.values() if each.shown < oldest]:
            self._close(vehicle)
        ended = None
        shown = {track.id for track in frame.tracks}
        if not shown <= self._vehicles.keys():
            ended = self._ended(shown)
        for track in frame.tracks:
            self._see(track, frame.index, ended)

    def start_video(self) -> None:
        """Take the ids of the next frames for those of other tracks: they are of another video."""
        for vehicle in self._vehicles.values():
            vehicle.key = -vehicle.number
        self._vehicles = {each.key: each for each in self._vehicles.values()}

    def counts(self) -> Counts:
        """Return all results; the video has ended."""
        for vehicle in list(self._vehicles.values()):
            self._close(vehicle)
        events = [replace(event, class_name=scores.best) for event, scores in self._counted]
        events.sort(key=lambda e: (e.time, e.frame, e.id, e.name))
        ways = tuple((each.name, way) for each in self._borders for way in each.directions)
        zones = tuple(zone.name for zone in self.zones)
        first, last = (self._first, self._now) if self._first <= self._now else (0.0, 0.0)
        lines = self.lines if self._is_used else ()
        warnings = tuple(line_warnings(lines, events, self._missed, self._heights))
        return Counts(tuple(events), ways, zones, first, last, warnings=warnings)

    def count(self, name: str, direction: str) -> int:
        """Return how many vehicles have been counted so far in a direction of a line or zone."""
        return self._tally[name, direction]

    def present(self, zone: Zone) -> int:
        """Return how many vehicles are in a zone now."""
        return sum(
            state.border == zone and state.entered is not None
            for each in self._vehicles.values()
            if self._now - each.shown <= _GAP and self._is_confirmed(each)
            for state in each.states
        )

    def _see(self, track: Track, frame: int, ended: _Ended | None) -> None:
        # As exactly as files of tracks hold it, so that both count alike.
        point, box = track.written_foot, track.box
        height = float(max(1, math.floor(box.y2 + 0.5) - math.floor(box.y1 + 0.5)))
        sighting = Sighting(self._now, frame, point, height, track.score)
        vehicle = self._vehicles.get(track.id) or self._begin(track.id, sighting, ended)
        if vehicle.is_another(sighting):
            vehicle = self._split(vehicle, sighting)
        vehicle.classes.add(track.class_name, track.score)
        vehicle.box, vehicle.shown = box, self._now
        band = max(BAND * height, LEAST_BAND * self._size[1])
        if math.dist(point, vehicle.looked_at) + band >= vehicle.clear:
            self._look(vehicle, sighting, band)
        vehicle.move(sighting)
        if vehicle.events:
            self._confirm(vehicle)

    def _split(self, vehicle: _Vehicle, sighting: Sighting) -> _Vehicle:
        """End a vehicle; what its track did since it came back is done by another one."""
        self._close(vehicle)
        new = self._begin(vehicle.id, sighting, None)
        self._counted = [
            (replace(event, vehicle=new.number), classes)
            if event.vehicle == vehicle.number and event.time >= vehicle.again
            else (event, classes)
            for event, classes in self._counted
        ]
        return new

    def _look(self, vehicle: _Vehicle, sighting: Sighting, band: float) -> None:
        """Look what a vehicle does at the borders that it is near to."""
        near = []
        for state in vehicle.states:
            left = state.clear - math.dist(sighting.point, state.seen_at)
            if left <= band:
                before = state.side
                change = state.see(sighting, vehicle.last, band)
                if change is not None:
                    self._note(vehicle, state, change)
                elif before == 0 and state.side > 0 and isinstance(state.border, Zone):
                    state.entered = vehicle.first.time
                    vehicle.add(state.border.name, APPEAR, vehicle.first)
                left = state.clear
            near.append(left)
        vehicle.clear, vehicle.looked_at = min(near, default=math.inf), sighting.point

    def _begin(self, number: int, sighting: Sighting, ended: _Ended | None) -> _Vehicle:
        """Remember a new vehicle, which may go on from another that has ended."""
        vehicle = ended.take(sighting) if ended else None
        if vehicle is None:
            self.begun += 1
            states = [BorderState(border) for border in self._borders]
            vehicle = _Vehicle(number, number, self.begun, sighting, sighting, states)
        else:
            del self._vehicles[vehicle.key]
        vehicle.id = vehicle.key = number
        self._vehicles[number] = vehicle
        return vehicle

    def _ended(self, shown: set[int]) -> _Ended:
        """Return the vehicles that have just ended; those with a key in `shown` go on."""
        vehicles = [
            vehicle
            for vehicle in self._vehicles.values()
            if self._now - vehicle.shown <= _GAP
            and vehicle.key not in shown
            and not vehicle.is_leaving(*self._size)
        ]
        return _Ended(vehicles, self._now, self._size)

    def _is_confirmed(self, vehicle: _Vehicle) -> bool:
        seen = round(vehicle.last.time - vehicle.first.time, TIME_DIGITS)
        return seen >= self._confirmed

    def _confirm(self, vehicle: _Vehicle) -> None:
        """Count the vehicle's new events, if it is confirmed."""
        if self._is_confirmed(vehicle):
            for event in vehicle.events:
                self._tally[event.name, event.direction] += 1
                self._counted.append((event, vehicle.classes))
            vehicle.events.clear()

    def _close(self, vehicle: _Vehicle) -> None:
        """End a vehicle that is not shown any more; if it was lost, it drives on for a moment."""
        last, was_lost = vehicle.last, self._now - vehicle.shown > _GAP
        if was_lost and math.dist(last.point, vehicle.first.point) > last.height:
            for time in (last.time + seconds for seconds in _ONWARD):
                onward = last._replace(time=time, point=vehicle.expected(time))
                self._look(vehicle, onward, BAND * last.height)
        for state in vehicle.states:
            if (change := state.end(last)) is not None:
                self._note(vehicle, state, change)
            if state.entered is not None:
                end = max(last.time, state.entered)  # it may have entered while it drove on
                stay = end - state.entered
                vehicle.add(state.border.name, VANISH, last._replace(time=end), stay)
        self._confirm(vehicle)
        self._look_for_misses(vehicle)
        del self._vehicles[vehicle.key]

    def _note(self, vehicle: _Vehicle, state: BorderState, change: Change) -> None:
        """Note the event of a change, if the path meets the border."""
        if not change.meets:
            return
        border, seconds = state.border, None
        if isinstance(border, Zone):
            entered, state.entered = state.entered, change.time if change.side > 0 else None
            if change.side < 0:
                seconds = 0.0 if entered is None else change.time - entered
        else:
            self._heights[border.name].append(vehicle.last.height)
        vehicle.add(border.name, border.directions[change.side < 0], change, seconds)

    def _look_for_misses(self, vehicle: _Vehicle) -> None:
        """Note at which lines a vehicle begins or ends, but for the ends of the video."""
        ends = [
            *([vehicle.first] if vehicle.first.time > self._first else []),
            *([vehicle.last] if vehicle.shown < self._now else []),
        ]
        if self._is_confirmed(vehicle):
            self._is_used = True
            self._missed.update(
                state.border.name for state in vehicle.states if is_missed_at(state, ends)
            )
