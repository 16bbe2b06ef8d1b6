"""Trackers of any kind, made from settings."""

from collections import deque
from collections.abc import Callable
from dataclasses import astuple, replace
from math import inf

import numpy as np

from vdet.boxes import Box, Boxes
from vdet.config.kinds import TrackerKind
from vdet.config.schema import Settings
from vdet.media import Picture
from vdet.plugins import TRACKERS, load_plugin
from vdet.track.track import State, TimedTracker, Track, VideoTracker


def make_tracker(settings: Settings, width: int, height: int) -> TimedTracker:
    """Return a new tracker for the frames of one video, `width` × `height` pixels.

    Raises
    ------
    ConfigError
        The kind is unknown.
    """
    kind: TrackerKind = load_plugin(TRACKERS, settings.tracker.kind)
    return timed(kind.make(settings.tracker, width, height))


def timed(tracker: VideoTracker) -> TimedTracker:
    """Return a tracker that knows its vehicles at any time: the tracker itself, or a wrapper.

    With the wrapper, vehicles move straight from one box to the next between two searched frames;
    after the latest frame they stay where they are.
    """
    return tracker if isinstance(tracker, TimedTracker) else InterpolatingTracker(tracker)


class InterpolatingTracker:
    """Shows the tracks of another tracker at any time; a `TimedTracker`.

    Attributes
    ----------
    tracker
        The wrapped tracker. It receives only searched frames, with their times.
    """

    def __init__(self, tracker: VideoTracker) -> None:
        self.tracker = tracker
        self._searched: list[tuple[float, list[Track]]] = []

    def observe(self, detections: Boxes, time: float, picture: Picture | None = None) -> None:
        """Follow the vehicles into the next frame; as `TimedTracker.observe`."""
        self._searched.append((time, self.tracker.update(detections, time, picture)))

    def at(self, time: float) -> list[Track]:
        """Return the vehicles shown at a time; as `TimedTracker.at`."""
        while len(self._searched) > 1 and self._searched[1][0] <= time:
            del self._searched[0]
        if not self._searched:
            return []
        begin, tracks = self._searched[0]
        if time <= begin:
            return tracks
        end, following = self._searched[1] if len(self._searched) > 1 else (inf, tracks)
        ends = {track.id: track for track in following}
        fraction = (time - begin) / (end - begin)
        return [_moved(track, ends[track.id], fraction) for track in tracks if track.id in ends]


class ShotTracker:
    """Shows the tracks of a new tracker after each jump cut; a `TimedTracker`. Ids go on.

    Parameters
    ----------
    make
        Makes a tracker.
    """

    def __init__(self, make: Callable[[], TimedTracker]) -> None:
        self._make = make
        self._shots = deque([(-inf, make())])
        self._shift = self._largest = 0

    def begin_shot(self, time: float) -> None:
        """End all tracks before a frame, of which this is the time; none later was observed."""
        self._shots.append((time, self._make()))

    def observe(self, detections: Boxes, time: float, picture: Picture | None = None) -> None:
        """Follow the vehicles into the next frame; as `TimedTracker.observe`."""
        self._shots[-1][1].observe(detections, time, picture)

    def at(self, time: float) -> list[Track]:
        """Return the vehicles shown at a time; as `TimedTracker.at`."""
        while len(self._shots) > 1 and self._shots[1][0] <= time:
            self._shots.popleft()
            self._shift = self._largest
        tracks = self._shots[0][1].at(time)
        if self._shift:
            tracks = [replace(track, id=track.id + self._shift) for track in tracks]
        self._largest = max([self._largest, *(track.id for track in tracks)])
        return tracks


def _moved(track: Track, end: Track, fraction: float) -> Track:
    """Return a track that has done this fraction of its way to `end`."""
    first, last = (np.array([*astuple(item.box), *item.foot]) for item in (track, end))
    x1, y1, x2, y2, foot_x, foot_y = (first + (last - first) * fraction).tolist()
    state: State = "predicted" if track.state == "predicted" else "interpolated"
    return replace(track, box=Box(x1, y1, x2, y2), whole_foot=(foot_x, foot_y), state=state)
