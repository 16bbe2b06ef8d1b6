"""Vehicles that move on paths, as tracks, for the tests of counting."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import groupby, pairwise
from typing import Any

from vdet.boxes import Box
from vdet.config.scene import CameraSettings, LineSettings, TrafficSettings, ZoneSettings
from vdet.config.schema import Settings
from vdet.polygons import Point
from vdet.track.track import FrameTracks, State, Track
from vdet.traffic.counting import count_frames
from vdet.traffic.counts import Counts, Event

WIDTH, HEIGHT = 1280, 720
CAR_HEIGHT = 60

Path = Callable[[float], Point | None]
"""Where the foot of a vehicle is at a time; None where it is not seen."""


def track(
    foot: Point,
    number: int = 1,
    *,
    height: int = CAR_HEIGHT,
    score: float = 0.9,
    name: str | None = None,
    state: State = "detected",
) -> Track:
    """Return a track that stands at `foot`."""
    box = Box.sized(round(foot[0]) - height // 2, round(foot[1]) - height, height, height)
    return Track(number, box, score, state, name, foot)


def through(*points: tuple[float, float, float], gone: Sequence[tuple[float, float]] = ()) -> Path:
    """Return a straight path between points of time, x and y; `gone` are times without it."""

    def path(time: float) -> Point | None:
        if not points[0][0] <= time <= points[-1][0] or any(a <= time < b for a, b in gone):
            return None
        for (t0, x0, y0), (t1, x1, y1) in pairwise(points):
            if t0 <= time <= t1:
                fraction = (time - t0) / (t1 - t0)
                return x0 + fraction * (x1 - x0), y0 + fraction * (y1 - y0)
        return None

    return path


def frames(
    *paths: Path, rate: float = 25, seconds: float = 10, scale: float = 1
) -> Iterator[FrameTracks]:
    """Give the frames of vehicles on paths, by their numbers from 1."""
    for index in range(round(seconds * rate) + 1):
        time = index / rate
        tracks = [
            track((scale * foot[0], scale * foot[1]), number, height=round(scale * CAR_HEIGHT))
            for number, path in enumerate(paths, start=1)
            if (foot := path(time)) is not None
        ]
        yield FrameTracks(index, time, tuple(tracks))


def joined(*videos: Iterable[FrameTracks]) -> list[FrameTracks]:
    """Put the tracks of several videos into the frames of one."""
    every = sorted((frame for video in videos for frame in video), key=lambda video: video.index)
    return [
        FrameTracks(index, group[0].time, tuple(t for item in group for t in item.tracks))
        for index, group in ((i, list(g)) for i, g in groupby(every, lambda item: item.index))
    ]


def feet(*points: Point | None, rate: float = 25, **options: Any) -> list[FrameTracks]:
    """Give the frames of one vehicle at these places; None where it is not seen."""
    return [
        FrameTracks(i, i / rate, () if p is None else (track(p, **options),))
        for i, p in enumerate(points)
    ]


def numbered(video: Iterable[FrameTracks], number: int) -> list[FrameTracks]:
    """Give the tracks another id."""
    return [
        replace(frame, tracks=tuple(replace(t, id=number) for t in frame.tracks)) for frame in video
    ]


def named(video: Iterable[FrameTracks], name: str) -> list[FrameTracks]:
    """Give the tracks a class."""
    return [
        replace(frame, tracks=tuple(replace(t, class_name=name) for t in frame.tracks))
        for frame in video
    ]


LINE = LineSettings(name="line", start=(200, 400), end=(1000, 400), left="away", right="here")
"""From left to right across the road: vehicles that come nearer cross it to its right."""
ZONE = ZoneSettings(name="zone", points=((400, 300), (800, 300), (800, 500), (400, 500)))


def counts(
    video: Iterable[FrameTracks],
    *shapes: LineSettings | ZoneSettings,
    size: tuple[int, int] = (WIDTH, HEIGHT),
    **rule: Any,
) -> Counts:
    """Count at lines and zones, given in pixels of 1280×720, in frames of this size."""
    return count_frames(video, settings_for(*shapes, **rule), size)


def settings_for(*shapes: LineSettings | ZoneSettings, **rule: Any) -> Settings:
    """Return settings with lines and zones that are given in pixels of 1280×720."""

    def scaled(point: Point) -> Point:
        return point[0] / WIDTH, point[1] / HEIGHT

    lines = tuple(
        shape.model_copy(update={"start": scaled(shape.start), "end": scaled(shape.end)})
        for shape in shapes
        if isinstance(shape, LineSettings)
    )
    zones = tuple(
        shape.model_copy(update={"points": tuple(map(scaled, shape.points))})
        for shape in shapes
        if isinstance(shape, ZoneSettings)
    )
    traffic = TrafficSettings(lines=lines, zones=zones, **rule)
    return Settings(camera=CameraSettings(size=(WIDTH, HEIGHT)), traffic=traffic)


def events(
    video: Iterable[FrameTracks], *shapes: LineSettings | ZoneSettings, **options: Any
) -> tuple[Event, ...]:
    """Return the events at these lines and zones."""
    return counts(video, *(shapes or (LINE,)), **options).events


def ways(found: Iterable[Event]) -> list[str]:
    """Return the directions of events."""
    return [event.direction for event in found]
