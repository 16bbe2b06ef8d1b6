"""A tracker from its settings, of any kind."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from vdet.boxes import Boxes
from vdet.config.schema import MotionTrackerSettings, Settings, TrackerSettings
from vdet.config.section import REFERENCE_HEIGHT, scale_lengths
from vdet.config.tracker import RulesTrackerSettings
from vdet.media import Picture
from vdet.plugins import TRACKERS, load_plugin
from vdet.track.motion.tracker import MotionTracker
from vdet.track.rules.tracker import RulesTracker
from vdet.track.track import CarryingTracker, Track, VideoTracker


@dataclass(frozen=True, slots=True)
class TrackerKind:
    """A kind of tracker, as it is registered under its name.

    Attributes
    ----------
    settings
        Class of the section `tracker` for this kind; its `kind` has the name as default.
    make
        Takes these settings and the width and height of the frames, pixels.
    """

    settings: type[TrackerSettings]
    make: Callable[[Any, int, int], VideoTracker]


def make_tracker(settings: Settings, width: int, height: int) -> CarryingTracker:
    """Return a new tracker for the frames of one video, `width` × `height` pixels.

    Raises
    ------
    ConfigError
        There is no such kind.
    """
    kind: TrackerKind = load_plugin(TRACKERS, settings.tracker.kind)
    return carrying(kind.make(settings.tracker, width, height))


def carrying(tracker: VideoTracker) -> CarryingTracker:
    """Return a tracker that can carry vehicles: the tracker itself, or one that holds its vehicles.

    Held vehicles stay where they are in frames that are not searched.
    """
    return tracker if isinstance(tracker, CarryingTracker) else HoldingTracker(tracker)


class HoldingTracker:
    """Shows the latest tracks of another tracker again; a `CarryingTracker`.

    Attributes
    ----------
    tracker
        The other one. It sees the searched frames only, with their times.
    """

    def __init__(self, tracker: VideoTracker) -> None:
        self.tracker = tracker
        self._shown: list[Track] = []

    def update(self, detections: Boxes, time: float, picture: Picture | None = None) -> list[Track]:
        """Follow the vehicles into a frame that was searched; as `VideoTracker.update`."""
        self._shown = self.tracker.update(detections, time, picture)
        return self._shown

    def carry(self, time: float, picture: Picture | None = None) -> list[Track]:  # noqa: ARG002
        """Return the vehicles of the latest searched frame; as `CarryingTracker.carry`."""
        return [replace(track, predicted=True) for track in self._shown]


def _make_rules(settings: RulesTrackerSettings, width: int, height: int) -> VideoTracker:  # noqa: ARG001
    return RulesTracker(scale_lengths(settings, height / REFERENCE_HEIGHT))


MOTION = TrackerKind(MotionTrackerSettings, MotionTracker)
RULES = TrackerKind(RulesTrackerSettings, _make_rules)
