"""A record and the best image of each vehicle, from its tracks; files of records."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from vdet.boxes import Box, Image
from vdet.media import Picture
from vdet.media.images import coarse_scale, shrunk
from vdet.polygons import Point
from vdet.track.track import FrameTracks, State, Track
from vdet.traffic.clock import Clock
from vdet.traffic.crossings import path_moves
from vdet.traffic.output import VIDEO, is_json, plain_time, write_content
from vdet.traffic.speeds import KMH, SpeedMeter, Speeds

PATH_STEP = 0.01
"""Minimum distance between points of a path, as a fraction of the frame's width.

Shorter movements are jitter of the boxes.
"""

_STANDING = 60.0
"""Seconds after which a vehicle that has not moved is standing."""

_GLIMPSE = 0.05
"""Seconds; what is shown for less, such as in one frame at the edge of a region, has no record."""

_SHORT, _HIGH = 0.5, 0.6
"""A sure vehicle is shown for at least these seconds, with at least this best score. What reaches
neither before a camera that may move has no record: it is often a sign or a building.
"""

Motion = Literal["drove", "standing", "unknown"]
"""Whether a vehicle moved, as seen by a still camera; "unknown": it did not, but was shown for less
than a minute.
"""

_PADDING = 0.1  # margin around a vehicle, as a fraction of the width and height of its box
_MIN_SIDE = 24  # minimum side of a box that gets an image, pixels

_Merit = tuple[bool, float]
"""Whether the frame shows the whole vehicle; its area in pixels times its score."""


@dataclass(slots=True)
class VehicleRecord:
    """A vehicle over a whole video.

    Attributes
    ----------
    frame_width
        Width of the frames, pixels.
    first, last
        Times of the first and the last frame that show it, seconds.
    largest
        The box with the largest area, pixels.
    seconds
        How long it is shown. A frame lasts until the next one, the last frame as long as the
        previous one.
    states
        Number of frames that show it in each state of `Track`.
    best_score, sum_of_scores
        Over these frames, 0 to 1.
    class_name
        The class in its last frame: see `vdet.track.track`.
    path
        Ground points (`Track.foot`): the first, one after each step of `PATH_STEP`, and the last.
        Predicted ones are omitted, unless all are.
    followed
        Spans in which it is shown and not predicted, seconds; if it always is, the whole span.
    speeds
        None if unknown.
    motion
        None if the camera may have moved.
    distance
        Minimum distance from the camera, metres; None if unknown.
    lanes
        Number of frames that show it in each lane, as `Track.lane` counts them.
    corrected
        The files by which a reviewer corrected its class.
    """

    id: int
    frame_width: int
    first: float
    last: float
    largest: Box
    seconds: float = 0.0
    states: Counter[State] = field(default_factory=Counter)
    best_score: float = 0.0
    sum_of_scores: float = 0.0
    class_name: str | None = None
    path: list[Point] = field(default_factory=list)
    followed: list[tuple[float, float]] = field(default_factory=list)
    speeds: Speeds | None = None
    motion: Motion | None = None
    distance: float | None = None
    lanes: Counter[int] = field(default_factory=Counter)
    corrected: tuple[str, ...] = ()

    @property
    def lane(self) -> int | None:
        """Its most frequent lane; None if unknown."""
        return next((lane for lane, _ in self.lanes.most_common(1)), None)

    @property
    def has_moved(self) -> bool:
        """Whether it moved, or may have, because the camera may have moved."""
        return self.motion in (None, "drove")

    @property
    def is_sure(self) -> bool:
        """Whether it was shown for at least half a second, with a best score of at least 0.6."""
        return self.seconds >= _SHORT and self.best_score >= _HIGH

    @property
    def mean_score(self) -> float:
        """Mean of the scores of all its frames, 0 to 1."""
        return self.sum_of_scores / self.states.total()

    @property
    def length(self) -> float:
        """Length of the path, pixels."""
        return sum(map(math.dist, self.path, self.path[1:]))

    @property
    def length_fraction(self) -> float:
        """Length of the path as a fraction of the frame's width."""
        return self.length / self.frame_width

    def add(self, track: Track, time: float, before: float | None = None) -> None:
        """Add the next frame that shows it; `before` is the time of the previous frame."""
        self.last = time
        self.sum_of_scores += track.score
        self.best_score = max(self.best_score, track.score)
        self.class_name = track.class_name
        self.largest = max(self.largest, track.box, key=lambda box: box.area)
        if track.distance is not None:
            nearest = track.distance if self.distance is None else self.distance
            self.distance = min(track.distance, nearest)
        if track.lane is not None:
            self.lanes[track.lane] += 1
        is_predicted = track.state == "predicted"
        was_seen = self.states.total() > self.states["predicted"]
        if not is_predicted and not was_seen:
            self.path.clear()
            self.followed.clear()
        if not (is_predicted and was_seen):
            self._go_to(track.foot)
            continues = bool(self.followed) and self.followed[-1][1] == before
            first = self.followed.pop()[0] if continues else time
            self.followed.append((first, time))
        self.states[track.state] += 1

    def judge(self) -> None:
        """Set `motion`, for a still camera."""
        stood: Motion = "standing" if self.seconds >= _STANDING else "unknown"
        moved = path_moves(np.array(self.path), self.largest.size)
        self.motion = "drove" if moved else stood

    def _go_to(self, point: Point) -> None:
        """Continue the path; a last point less than a step from the previous one is replaced."""
        step = PATH_STEP * self.frame_width
        if len(self.path) > 1 and math.dist(self.path[-2], self.path[-1]) < step:
            self.path.pop()
        self.path.append(point)


class VehicleRecords:
    """Makes the records, frame by frame, without keeping frames.

    Parameters
    ----------
    width
        Width of the frames, pixels.
    """

    def __init__(self, width: int) -> None:
        self._width = width
        self._vehicles: dict[int, VehicleRecord] = {}
        self._latest: FrameTracks | None = None
        self._period = 0.0

    def add(self, frame: FrameTracks) -> None:
        """Add the next frame. Frames without a vehicle may be omitted."""
        before = None
        if self._latest:
            frames = max(1, frame.index - self._latest.index)
            before = self._latest.time if frames == 1 else None
            self._period = (frame.time - self._latest.time) / frames
            self._show()
        for track in frame.tracks:
            if track.id not in self._vehicles:
                first = VehicleRecord(track.id, self._width, frame.time, frame.time, track.box)
                self._vehicles[track.id] = first
            self._vehicles[track.id].add(track, frame.time, before)
        self._latest = frame

    def end(
        self, meter: SpeedMeter | None = None, *, is_still: bool = False
    ) -> tuple[VehicleRecord, ...]:
        """Return the records by id, with the speeds of a meter; call it once, at the end.

        If the camera `is_still`, they have a `motion`.
        """
        self._show()
        for number, speeds in (meter.speeds() if meter else {}).items():
            self._vehicles[number].speeds = speeds
        records = [
            record
            for _, record in sorted(self._vehicles.items())
            if not 0 < record.seconds < _GLIMPSE
            and (is_still or record.seconds >= _SHORT or record.best_score >= _HIGH)
        ]
        if is_still:
            for record in records:
                record.judge()
        return tuple(records)

    def _show(self) -> None:
        for track in self._latest.tracks if self._latest else ():
            self._vehicles[track.id].seconds += self._period


COLUMNS: dict[str, Callable[[VehicleRecord], Any]] = {
    "id": lambda record: record.id,
    "class": lambda record: record.class_name,
    "clock": lambda _: None,  # filled in if the clock is known
    "first": lambda record: round(record.first, 6),
    "last": lambda record: round(record.last, 6),
    "seconds": lambda record: round(record.seconds, 3),
    "detected": lambda record: record.states["detected"],
    "interpolated": lambda record: record.states["interpolated"],
    "predicted": lambda record: record.states["predicted"],
    "mean_score": lambda record: round(record.mean_score, 4),
    "best_score": lambda record: round(record.best_score, 4),
    "start_x": lambda record: round(record.path[0][0], 1),
    "start_y": lambda record: round(record.path[0][1], 1),
    "end_x": lambda record: round(record.path[-1][0], 1),
    "end_y": lambda record: round(record.path[-1][1], 1),
    "length": lambda record: round(record.length, 1),
    "length_fraction": lambda record: round(record.length_fraction, 4),
    "x": lambda record: record.largest.xywh[0],
    "y": lambda record: record.largest.xywh[1],
    "width": lambda record: record.largest.xywh[2],
    "height": lambda record: record.largest.xywh[3],
    "metres": lambda record: record.speeds and round(record.speeds.metres, 1),
    "speed": lambda record: record.speeds and round(KMH * record.speeds.quantile(0.5), 1),
    "speed_85": lambda record: record.speeds and round(KMH * record.speeds.quantile(0.85), 1),
    "speed_sd": lambda record: record.speeds and round(KMH * record.speeds.deviation, 1),
    "motion": lambda record: record.motion,
    "distance": lambda record: None if record.distance is None else round(record.distance, 1),
    "lane": lambda record: record.lane,
}
"""The columns of a `.csv`. `clock` is the clock time of `first`; x, y, width and height are the
largest box; speeds are in km/h; `distance` is the minimum distance from the camera, metres.
"""


def records_content(
    records: Iterable[VehicleRecord], path: Path, clock: Clock | None = None
) -> list[Any]:
    """Return the content of the file `path`, for `write_content`."""
    if is_json(path):
        return [_item(record, clock) for record in records]
    return [tuple(COLUMNS), *(list(_row(record, clock).values()) for record in records)]


def join_records(videos: Mapping[str, list[Any]], target: Path) -> None:
    """Write one file for many videos, from the content for each; records have their video."""
    if is_json(target):
        items = [{VIDEO: name, **item} for name, items in videos.items() for item in items]
        write_content(target, items)
    else:
        rows = [[name, *row] for name, (_, *body) in videos.items() for row in body]
        write_content(target, [[VIDEO, *COLUMNS], *rows])


def _row(record: VehicleRecord, clock: Clock | None) -> dict[str, Any]:
    """Return the values of a record by column."""
    row = {name: value(record) for name, value in COLUMNS.items()}
    return row | {"clock": plain_time(clock and clock.at(round(record.first, 3)))}


def _item(record: VehicleRecord, clock: Clock | None) -> dict[str, Any]:
    """Return a record for JSON: its row, with the path and the largest box as objects."""
    row = _row(record, clock)
    path = {end: [row[f"{end}_x"], row[f"{end}_y"]] for end in ("start", "end")}
    path |= {name: row[name] for name in ("length", "length_fraction")}
    largest = {name: row[name] for name in ("x", "y", "width", "height")}
    columns = list(row)
    start, end = columns.index("start_x"), columns.index("metres")
    return {
        **{name: row[name] for name in columns[:start]},
        "path": path,
        "largest": largest,
        **{name: row[name] for name in columns[end:]},
        **({"corrected": list(record.corrected)} if record.corrected else {}),
    }


@dataclass(frozen=True, slots=True)
class Crop:
    """An image of a vehicle: `time` of the frame in seconds, and BGR uint8 `(H, W, 3)`."""

    id: int
    time: float
    image: Image


class BestCrops:
    """Finds the best image of each vehicle, frame by frame.

    Only images of vehicles in the last frame are kept in memory. The others are returned, so memory
    does not grow with the length of the video. `is_coarse` is `output.coarse`. Several sinks may
    add the same frames.
    """

    def __init__(self, *, is_coarse: bool = False) -> None:
        self._is_coarse = is_coarse
        self._best: dict[int, Callable[[], Crop]] = {}
        self._merits: dict[int, _Merit] = {}
        self._latest: FrameTracks | None = None
        self._gone: list[Crop] = []

    def add(self, frame: FrameTracks, picture: Picture) -> list[Crop]:
        """Add the next frame.

        Returns
        -------
        The best images so far of the vehicles that this frame no longer shows. If a vehicle
        reappears and gets a better image, it is returned again.
        """
        if frame is self._latest:
            return self._gone
        shown = {track.id for track in frame.tracks}
        self._latest = frame
        self._gone = [self._best.pop(number)() for number in sorted(self._best.keys() - shown)]
        for track in frame.tracks:
            merit = _merit(track, picture)
            if merit and merit > self._merits.get(track.id, (False, 0.0)):
                self._merits[track.id] = merit
                part = picture.deferred_crop(_padded(track.box.rounded))
                self._best[track.id] = partial(self._crop, track, frame.time, part)
        return self._gone

    def end(self) -> list[Crop]:
        """Return the images of the vehicles that the last frame shows."""
        return [self._best[number]() for number in sorted(self._best)]

    def _crop(self, track: Track, time: float, part: Callable[[], Image]) -> Crop:
        side = max(track.box.width, track.box.height)
        scale = coarse_scale(side, side) if self._is_coarse else 1.0
        return Crop(track.id, time, shrunk(part(), scale))


def _padded(box: Box) -> Box:
    x, y = (round(side * _PADDING) for side in (box.width, box.height))
    return Box(box.x1 - x, box.y1 - y, box.x2 + x, box.y2 + y)


def _merit(track: Track, picture: Picture) -> _Merit | None:
    """Return None if the vehicle is not detected in this frame, or too small."""
    box = track.box.rounded
    if track.state != "detected" or min(box.width, box.height) < _MIN_SIDE:
        return None
    is_whole = not any(box.cut_by((picture.width, picture.height)))
    return is_whole, box.area * track.score
