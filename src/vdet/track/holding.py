"""A tracker that cannot carry: its vehicles stay where they are in frames that are not searched."""

from dataclasses import replace

from vdet.boxes import Boxes
from vdet.media import Picture
from vdet.track.protocol import VideoTracker
from vdet.track.track import Track


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
