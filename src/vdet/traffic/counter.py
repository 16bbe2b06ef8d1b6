"""The counter: from the tracks of each frame to events. `vdet.traffic` explains the rule."""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from statistics import median

from vdet.config.schema import Settings
from vdet.detect.classes import is_chosen
from vdet.track.track import FrameTracks
from vdet.traffic.clock import Span, add_frame
from vdet.traffic.counts import Counts, Direction, Event
from vdet.traffic.crossings import (
    VANISH,
    Border,
    Crossing,
    PlacedLine,
    crossings,
    lines_near,
    place,
)
from vdet.traffic.linking import MAX_GAP, TrackLinker, VehiclePath

_MAX_AGE = 0.2
"""Seconds after which running counts are recomputed."""
_NEAR_LINE = 0.5
"""Distance within which the end of a track is at a line, in heights of its box."""
_FEW_WRONG = 0.05
"""Fraction of the crossings of a line up to which wrong tracks there cause no warning."""


@dataclass(frozen=True, slots=True)
class _Passage:
    """The events of a vehicle, and by line or zone the heights of its box at these, pixels.

    `missed` are the lines at which its path begins or ends without crossing them.
    """

    events: list[Event]
    heights: dict[str, list[float]]
    missed: list[str]


class VehicleCounter:
    """Counts the vehicles of one video, or of several that follow one another.

    Parameters
    ----------
    started
        Number of vehicles counted before.

    Attributes
    ----------
    lines, zones
        Places in its frames.
    spans
        The parts with video, seconds.
    linker
        Knows how many vehicles have started.

    Raises
    ------
    ConfigError
        `camera.size` has another aspect ratio than `width` × `height` pixels.
    """

    def __init__(self, settings: Settings, width: int, height: int, started: int = 0) -> None:
        self._settings = settings
        self.lines, self.zones = place(settings.traffic, width, height)
        self.spans: list[Span] = []
        self._borders: tuple[Border, ...] = (*self.lines, *self.zones)
        self.linker = TrackLinker(width, height, started)
        self._ended: list[_Passage] = []
        self._tally: Counter[Direction] = Counter()  # of those
        self._latest: FrameTracks | None = None
        self._so_far: Counter[Direction] = Counter()
        self._counted = -math.inf

    def update(self, frame: FrameTracks) -> None:
        """Add the tracks of the next frame."""
        add_frame(self.spans, frame, self._latest)
        self._latest = frame
        ended = self._passages(self.linker.add(frame))
        self._ended += ended
        events = (event for passage in ended for event in passage.events)
        self._tally.update((event.name, event.direction) for event in events)

    def start_video(self) -> None:
        """Treat the ids of the next frames as other tracks, because they are of another video."""
        self._latest = None
        self.linker.start_video()

    def counts(self) -> Counts:
        """Return all results, as if the video ended now."""
        passages = self._ended + self._passages(self.linker.open_paths())
        events = [event for passage in passages for event in passage.events]
        events.sort(key=lambda item: (item.time, item.frame, item.id, item.name))
        pairs = tuple((border.name, name) for border in self._borders for name in border.directions)
        zones, spans = tuple(zone.name for zone in self.zones), tuple(self.spans) or ((0.0, 0.0),)
        warnings = tuple(_line_warnings(self.lines, passages))
        return Counts(tuple(events), pairs, zones, spans, warnings=warnings)

    def so_far(self) -> Counter[Direction]:
        """Return the count of each direction so far; vehicles in a zone have not left it.

        The counts may be `_MAX_AGE` seconds old, so that this can be called for each frame.
        """
        now = self.spans[-1][1]
        if now - self._counted >= _MAX_AGE:
            self._counted = now
            still = self._passages(self.linker.open_paths())
            self._so_far = self._tally + Counter(
                (event.name, event.direction)
                for passage in still
                for event in passage.events
                if event.direction != VANISH or now - event.time > MAX_GAP
            )
        return self._so_far

    def _passages(self, paths: Iterable[VehiclePath]) -> list[_Passage]:
        """Return the passages that count: of the classes, seen long enough, and not parked."""
        minimum, classes = self._settings.traffic.min_seen_seconds, self._settings.classes
        seen = (path for path in paths if path.seconds >= minimum and path.has_driven)
        return [self._passage(path) for path in seen if is_chosen(path.class_name, classes)]

    def _passage(self, path: VehiclePath) -> _Passage:
        found = {border.name: crossings(path, border) for border in self._borders}
        last, (start, _), (_, now) = path.seen - 1, self.spans[0], self.spans[-1]
        # The ends of the path, except at the ends of the video.
        rows = [row for row in (0, last) if start < path.times[row] < now]
        points, reach = path.points[rows], _NEAR_LINE * path.heights[rows]
        events, heights = list[Event](), {}
        for name, crossed in found.items():
            events += [_event(path, name, crossing) for crossing in crossed]
            heights[name] = path.heights[[crossing.row for crossing in crossed]].tolist()
        others = [line for line in self.lines if not found[line.name]]
        missed = [line.name for line in lines_near(others, points, reach)]
        return _Passage(events, heights, missed)


def _event(path: VehiclePath, name: str, crossing: Crossing) -> Event:
    row, stay = crossing.row, crossing.seconds
    time, frame, score = round(crossing.time, 3), int(path.frames[row]), float(path.scores[row])
    known = path.track_at(row), path.vehicle, path.class_name, round(score, 4)
    stay = None if stay is None else round(stay, 3)
    return Event(time, frame, name, crossing.direction, *known, stay)


def _line_warnings(lines: Sequence[PlacedLine], passages: Sequence[_Passage]) -> Iterator[str]:
    """Yield a sentence for each problem of a line that the tracks of a run show."""
    for line in lines if passages else ():
        found = [heights for passage in passages if (heights := passage.heights[line.name])]
        few = _FEW_WRONG * len(found)
        missed = sum(line.name in passage.missed for passage in passages)
        again = sum(len(heights) > 1 for heights in found)
        if not found:
            yield f"{line.name}: no path crosses this line; move it"
        if missed > few:
            yield (
                f"{line.name}: tracks that begin or end at this line and are not counted: "
                f"{missed}; move it to where vehicles are tracked longer"
            )
        if again > few:
            yield (
                f"{line.name}: paths that cross this line more than once: {again}; place it across "
                "the road"
            )
        if found and line.length < median(height for heights in found for height in heights):
            yield f"{line.name}: this line is shorter than a vehicle; make it longer"
