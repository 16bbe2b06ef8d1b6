"""The protocol of all trackers, and the vehicles that they show in a frame."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol, runtime_checkable

from vdet.boxes import Box, Boxes
from vdet.media import Picture

State = Literal["seen", "between", "lost"]
"""How a vehicle is known in a frame: see `Track`."""


@dataclass(frozen=True, slots=True)
class Track:
    """A vehicle as it is shown in one frame.

    Attributes
    ----------
    id
        1, 2, 3 … in the order in which the vehicles of a video are first shown; an id is never
        used again for another vehicle.
    box
        Its place in pixels of the full frame. From the motion tracker: the estimate for this frame,
        the part inside the frame. From the rules: the average of the car's last rectangles
        (`tracker.history` of them), in whole pixels, which lie in the frame.
    score
        0 to 1: the share of shown boxes with such a score that are vehicles.
    state
        "seen": the detector saw the vehicle in this frame. "between": it saw it before and after,
        or the frame was not searched; the box lies between its detections. "lost": it did not see
        the vehicle again; the box is where its motion leads or, by the rules, where its image was
        found again.
    class_name
        Its class, one of `Boxes.names`; None where the detector does not know classes.
    whole_foot
        Middle of the lower edge of the whole box, with its part outside the frame; x and y, pixels.
        None where the tracker does not know it: see `foot`.
    distance
        Metres along the road from the camera to the vehicle; None where it is not known.
    lane
        0 in the own lane, 1 in the next one to the right, -1 to the left and so on; None where it
        is not known.
    """

    id: int
    box: Box
    score: float
    state: State
    class_name: str | None = None
    whole_foot: tuple[float, float] | None = None
    distance: float | None = None
    lane: int | None = None

    @property
    def foot(self) -> tuple[float, float]:
        """Where the vehicle stands: the middle of its lower edge, x and y in pixels."""
        return self.whole_foot or self.box.foot

    @property
    def written_foot(self) -> tuple[float, float]:
        """The foot as exactly as files have it, to a hundredth of a pixel."""
        x, y = self.whole_foot or self.box.foot
        return round(100 * x) / 100, round(100 * y) / 100  # round(x, 2) takes thrice as long


@dataclass(frozen=True, slots=True)
class FrameTracks:
    """The vehicles that are shown in one frame of a video.

    Attributes
    ----------
    index
        Number of the frame, from 0 at the start of the video.
    time
        When the frame is shown, seconds.
    tracks
        By id.
    facts
        More about the frame, as values for JSON: `lane` if lanes are searched for.
    """

    index: int
    time: float
    tracks: tuple[Track, ...]
    facts: Mapping[str, Any] = field(default_factory=dict)


class VideoTracker(Protocol):
    """Follows the vehicles of one video; a new one is made for every video."""

    def update(self, detections: Boxes, time: float, picture: Picture | None = None) -> list[Track]:
        """Follow the vehicles into the next frame.

        Parameters
        ----------
        detections
            What the detector sees in the frame.
        time
            When the frame is shown, seconds; it increases from frame to frame.
        picture
            The frame; only trackers that look at pixels need it.

        Returns
        -------
        The vehicles shown in this frame, by id.

        Raises
        ------
        ValueError
            The tracker looks at pixels, and `picture` is None.
        """


@runtime_checkable
class TimedTracker(Protocol):
    """A tracker that knows where its vehicles are at any time, also between searched frames.

    `vdet.track.factory.timed` makes one of a `VideoTracker`.
    """

    def observe(self, detections: Boxes, time: float, picture: Picture | None = None) -> None:
        """Follow the vehicles into the next frame; parameters as of `VideoTracker.update`."""

    def at(self, time: float) -> list[Track]:
        """Return the vehicles shown at a time, by id.

        Parameters
        ----------
        time
            Seconds; not earlier than in the call before. Before the time of the latest `observe`,
            what came after it is known: nothing earlier than `tracker.look_ahead` before that.
            Later than it, the vehicles move on.
        """
