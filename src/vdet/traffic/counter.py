"""From the tracks of each frame to events; `vdet.traffic` explains the rule."""

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from vdet.boxes import Box
from vdet.detect.classes import ClassScores
from vdet.polygons import Point
from vdet.track.track import FrameTracks, Track
from vdet.traffic.border import CLOCK, BorderState, Change, Sighting
from vdet.traffic.layout import APPEAR, VANISH, Layout, Zone
from vdet.traffic.totals import Counts, Event

REMEMBERED = 10.0
"""Seconds for which a vehicle that is not shown is remembered; trackers keep ids for less."""

_GAP = 1.0
"""Most seconds from the end of a track to that of another one that goes on from it."""
_SETTLED = 0.1
"""Seconds after which a vehicle off a border's band has changed the side."""
_LEAVES = 0.1
"""Heights of its box a second that a vehicle moves at least to leave the frame."""
_MOST_GROWTH = 2.0
"""A box is at most so many times as high as the one that it goes on from."""


def count_events(frames: Iterable[FrameTracks], layout: Layout) -> tuple[Event, ...]:
    """Return all events of a video, in the order of their times.

    Parameters
    ----------
    frames
        The tracks of each frame, in order; frames without tracks may be left out.
    """
    counter = VehicleCounter(layout)
    for frame in frames:
        counter.update(frame)
    return counter.finish()


@dataclass(slots=True)
class _Vehicle:
    """What is remembered of a track. `events` lack their class, which is known at the end."""

    id: int
    first: Sighting
    last: Sighting
    outward: Point  # the sides of the frame that its last box touches: x and y, -1, 0 or 1
    shown: float  # when it was last shown, also by prediction
    states: list[BorderState]
    entered: dict[int, float] = field(default_factory=dict)  # by the number of the zone
    velocity: Point = (0.0, 0.0)
    classes: ClassScores = field(default_factory=ClassScores)
    events: list[Event] = field(default_factory=list)
    tallied: int = 0
    is_taken_over: bool = False

    @property
    def is_leaving(self) -> bool:
        """Whether it moves out at the edge of the frame: then its end is no loss of the tracker."""
        outward = sum(v * side for v, side in zip(self.velocity, self.outward, strict=True))
        return outward > _LEAVES * self.last.height

    def expected(self, time: float) -> Point:
        """Return where it would be, had it gone on."""
        seconds = time - self.last.time
        (x, y), (dx, dy) = self.last.point, self.velocity
        return x + dx * seconds, y + dy * seconds

    def move(self, sighting: Sighting) -> None:
        """Take in the place of the next sighting."""
        seconds = sighting.time - self.last.time
        if seconds > 0:
            (ax, ay), (bx, by) = self.last.point, sighting.point
            dx, dy = self.velocity
            is_first = self.last is self.first
            share = 1.0 if is_first else 0.5
            self.velocity = (
                dx + share * ((bx - ax) / seconds - dx),
                dy + share * ((by - ay) / seconds - dy),
            )
        self.last = sighting

    def add(
        self,
        name: str,
        direction: str,
        at: Sighting | Change,
        *,
        stitched: bool = False,
        seconds: float | None = None,
    ) -> None:
        """Note an event."""
        self.events.append(
            Event(at.time, at.frame, name, direction, self.id, None, at.score, stitched, seconds)
        )


class VehicleCounter:
    """Counts the vehicles of one video; make a new one for every video.

    Attributes
    ----------
    layout
        The lines and zones in its frames.
    """

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self._borders = layout.borders
        self._vehicles: dict[int, _Vehicle] = {}
        self._events: list[Event] = []
        self._tally: Counter[tuple[str, str]] = Counter()
        self._now = -math.inf

    def update(self, frame: FrameTracks) -> None:
        """Take in the tracks of the next frame."""
        self._now = frame.time
        for vehicle in self._forgotten(frame.time):
            self._close(vehicle)
        shown = {track.id for track in frame.tracks}
        for track in frame.tracks:
            known = self._vehicles.get(track.id)
            if known is not None and known.is_taken_over:
                known = None
            if known is not None:
                known.shown = frame.time
            if not track.predicted:
                sighting = _sighting(track, frame)
                vehicle = known or self._begin(track.id, sighting, shown)
                vehicle.classes.add(track.class_name, track.score)
                vehicle.outward = _touched_sides(track.box, self.layout.size)
                self._see(vehicle, sighting)

    def finish(self) -> tuple[Event, ...]:
        """Return all events; the video has ended."""
        for vehicle in list(self._vehicles.values()):
            self._close(vehicle)
        return tuple(sorted(self._events, key=lambda e: (e.time, e.frame, e.id, e.name)))

    def counts(self) -> Counts:
        """Return all results; the video has ended."""
        zones = [zone.name for zone in self.layout.zones]
        return Counts.of(self.finish(), self.layout.keys, zones)

    def count(self, name: str, direction: str) -> int:
        """Return how many vehicles have been counted so far in a direction of a line or zone."""
        return self._tally[name, direction]

    def present(self, zone: Zone) -> int:
        """Return how many vehicles are in a zone now."""
        number = self._borders.index(zone)
        return sum(
            number in each.entered
            for each in self._vehicles.values()
            if not each.is_taken_over
            and self._now - each.shown <= _GAP
            and self._is_confirmed(each)
        )

    def _forgotten(self, now: float) -> list[_Vehicle]:
        return [each for each in self._vehicles.values() if now - each.shown > REMEMBERED]

    def _begin(self, number: int, sighting: Sighting, shown: set[int]) -> _Vehicle:
        """Remember a new vehicle, which may go on from another that has ended."""
        if number in self._vehicles:  # another has taken it over; this one begins anew
            self._close(self._vehicles[number])
        before = self._before(sighting, shown)
        if before is None:
            states = [BorderState() for _ in self._borders]
            vehicle = _Vehicle(number, sighting, sighting, (0, 0), sighting.time, states)
        else:
            before.is_taken_over = True
            vehicle = _Vehicle(
                number,
                before.first,
                before.last,
                (0, 0),
                sighting.time,
                [state.taken_over() for state in before.states],
                dict(before.entered),
                before.velocity,
                ClassScores(before.classes),
            )
        self._vehicles[number] = vehicle
        return vehicle

    def _before(self, sighting: Sighting, shown: set[int]) -> _Vehicle | None:
        """Return the vehicle that has ended where a new one begins."""
        near = []
        for vehicle in self._vehicles.values():
            if vehicle.id in shown or vehicle.is_taken_over or vehicle.is_leaving:
                continue
            heights = vehicle.last.height, sighting.height
            if sighting.time - vehicle.shown > _GAP or max(heights) > _MOST_GROWTH * min(heights):
                continue
            places = vehicle.last.point, vehicle.expected(sighting.time)
            distance = min(math.dist(place, sighting.point) for place in places)
            if distance <= max(heights):
                near.append((distance, vehicle.id))
        return self._vehicles[min(near)[1]] if near else None

    def _see(self, vehicle: _Vehicle, sighting: Sighting) -> None:
        band = self.layout.band(sighting.height)
        for number, (border, state) in enumerate(zip(self._borders, vehicle.states, strict=True)):
            before = state.side
            change = state.see(sighting, border, band, _SETTLED)
            if change is not None:
                self._note(vehicle, number, change)
            elif before == 0 and state.side > 0 and isinstance(border, Zone):
                vehicle.entered[number] = vehicle.first.time
                vehicle.add(border.name, APPEAR, vehicle.first)
        vehicle.move(sighting)
        self._confirm(vehicle)

    def _note(self, vehicle: _Vehicle, number: int, change: Change) -> None:
        border, seconds = self._borders[number], None
        if not change.meets:
            return
        if isinstance(border, Zone):
            if change.side > 0:
                vehicle.entered[number] = change.time
            else:
                seconds = change.time - vehicle.entered.pop(number, change.time)
        direction = border.direction(change.side)
        vehicle.add(border.name, direction, change, stitched=change.stitched, seconds=seconds)

    def _is_confirmed(self, vehicle: _Vehicle) -> bool:
        seen = vehicle.last.time - vehicle.first.time
        return seen >= self.layout.settings.confirmed - CLOCK

    def _confirm(self, vehicle: _Vehicle) -> None:
        """Count the vehicle's new events, if it is confirmed."""
        if not self._is_confirmed(vehicle):
            return
        for event in vehicle.events[vehicle.tallied :]:
            self._tally[event.name, event.direction] += 1
        vehicle.tallied = len(vehicle.events)

    def _close(self, vehicle: _Vehicle) -> None:
        """Keep the events of a vehicle that is not shown any more, and forget it."""
        del self._vehicles[vehicle.id]
        if not vehicle.is_taken_over:
            self._end(vehicle)
        self._confirm(vehicle)
        for event in vehicle.events[: vehicle.tallied]:
            self._events.append(_finished(event, vehicle.classes.best))

    def _end(self, vehicle: _Vehicle) -> None:
        for number, state in enumerate(vehicle.states):
            if (change := state.end()) is not None:
                self._note(vehicle, number, change)
        for number, entered in vehicle.entered.items():
            seconds = vehicle.last.time - entered
            vehicle.add(self._borders[number].name, VANISH, vehicle.last, seconds=seconds)


def _sighting(track: Track, frame: FrameTracks) -> Sighting:
    """Return where a track is, as exactly as files of tracks hold it, so that both count alike."""
    x, y = track.foot
    return Sighting(
        round(frame.time, 6),
        frame.index,
        (round(x, 2), round(y, 2)),
        float(track.box.xywh[3]),
        round(track.score, 4),
    )


def _touched_sides(box: Box, size: tuple[int, int]) -> Point:
    """Return at which sides of the frame a box is: -1 left or top, 1 right or bottom, 0 neither."""
    x1, y1, x2, y2 = box.pixels
    return (x2 >= size[0] - 1) - (x1 <= 1), (y2 >= size[1] - 1) - (y1 <= 1)


def _finished(event: Event, class_name: str | None) -> Event:
    seconds = None if event.seconds is None else round(event.seconds, 3)
    time, score = round(event.time, 3), round(event.score, 4)
    return replace(event, time=time, class_name=class_name, score=score, seconds=seconds)
