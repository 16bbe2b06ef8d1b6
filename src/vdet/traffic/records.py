"""A record of each vehicle, from the tracks of each frame."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from vdet.boxes import Box
from vdet.detect.classes import ClassScores
from vdet.track.track import FrameTracks, Track

Point = tuple[float, float]
"""x and y in pixels of the frame."""

PATH_STEP = 0.01
"""Distance after which a path gets its next point, as a share of the frame's width.

Shorter moves are jitter of the boxes.
"""


@dataclass(frozen=True, slots=True)
class VehicleRecord:
    """A vehicle over a whole video.

    Attributes
    ----------
    class_name
        The class with the highest sum of scores over its frames; None where none is told.
    first, last
        Times of the first and the last frame that show it, seconds.
    seconds
        How long it is shown. A frame is shown until the next one, the last frame as long as the one
        before it.
    seen, predicted
        Number of frames that show it where the detector saw it, and where it did not.
    mean_score, best_score
        Of these frames, 0 to 1.
    path
        Where it stood (`Track.foot`): the first point, a point after each step, and the last point.
        Only frames count in which it was seen, if there are any.
    length
        Of the path: pixels.
    share
        Length of the path as a share of the frame's width.
    largest
        The box with the largest area, pixels.
    """

    id: int
    class_name: str | None
    first: float
    last: float
    seconds: float
    seen: int
    predicted: int
    mean_score: float
    best_score: float
    path: tuple[Point, ...]
    length: float
    share: float
    largest: Box


class VehicleRecords:
    """Makes the records from frame to frame; it keeps no frame.

    Parameters
    ----------
    width
        Of the frames, pixels.
    """

    def __init__(self, width: int) -> None:
        self._width = width
        self._step = PATH_STEP * width
        self._vehicles: dict[int, _Vehicle] = {}
        self._latest: FrameTracks | None = None
        self._period = 0.0

    def add(self, frame: FrameTracks) -> None:
        """Add the next frame. Frames without a vehicle may be left out."""
        if self._latest:
            frames = max(1, frame.index - self._latest.index)
            self._period = (frame.time - self._latest.time) / frames
            self._show(self._latest)
        for track in frame.tracks:
            if track.id not in self._vehicles:
                self._vehicles[track.id] = _Vehicle(track, frame.time)
            self._vehicles[track.id].add(track, frame.time, self._step)
        self._latest = frame

    def _show(self, frame: FrameTracks) -> None:
        for track in frame.tracks:
            self._vehicles[track.id].seconds += self._period

    def end(self) -> tuple[VehicleRecord, ...]:
        """Return the records by id; call it once, after the last frame."""
        if self._latest:
            self._show(self._latest)
        return tuple(vehicle.record(self._width) for _, vehicle in sorted(self._vehicles.items()))


def summarize(frames: Iterable[FrameTracks], width: int) -> tuple[VehicleRecord, ...]:
    """Return a record of each vehicle, by id; `width` is that of the frames in pixels."""
    records = VehicleRecords(width)
    for frame in frames:
        records.add(frame)
    return records.end()


class _Vehicle:
    """A vehicle so far."""

    def __init__(self, track: Track, time: float) -> None:
        self.seconds = 0.0
        self._id = track.id
        self._first = self._last = time
        self._seen = self._predicted = 0
        self._scores = 0.0
        self._best = 0.0
        self._classes = ClassScores()
        self._largest = track.box
        self._points: list[Point] = []
        self._end: Point = track.foot

    def add(self, track: Track, time: float, step: float) -> None:
        self._last = time
        self._scores += track.score
        self._best = max(self._best, track.score)
        self._classes.add(track.class_name, track.score)
        if track.box.area > self._largest.area:
            self._largest = track.box
        self._go(track, step)
        if track.predicted:
            self._predicted += 1
        else:
            self._seen += 1

    def _go(self, track: Track, step: float) -> None:
        """Continue the path; what was seen first begins it anew, and then what was seen counts."""
        if track.predicted and self._seen:
            return
        self._end = track.foot
        if not (track.predicted or self._seen):
            self._points = []
        if not self._points or math.dist(self._points[-1], track.foot) >= max(step, 1e-9):
            self._points.append(track.foot)

    def record(self, width: int) -> VehicleRecord:
        path = tuple(self._points)
        if self._end != path[-1]:
            path = (*path, self._end)
        length = sum(map(math.dist, path, path[1:]))
        frames = self._seen + self._predicted
        return VehicleRecord(
            id=self._id,
            class_name=self._classes.best,
            first=self._first,
            last=self._last,
            seconds=self.seconds,
            seen=self._seen,
            predicted=self._predicted,
            mean_score=self._scores / frames,
            best_score=self._best,
            path=path,
            length=length,
            share=length / width,
            largest=self._largest,
        )
