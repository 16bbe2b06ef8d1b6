"""What the rest of the program knows of a tracker."""

from typing import Protocol, runtime_checkable

from vdet.boxes import Boxes
from vdet.media import Picture
from vdet.track.track import Track


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
class CarryingTracker(VideoTracker, Protocol):
    """A tracker that moves its vehicles on into frames that the detector did not search.

    A tracker without `carry` is given one by `vdet.track.factory.make_tracker`: there the vehicles
    stay where they were.
    """

    def carry(self, time: float, picture: Picture | None = None) -> list[Track]:
        """Follow the vehicles into the next frame, which was not searched.

        A vehicle that is not looked for is not missed: it must not be forgotten for it. All tracks
        are `predicted`.

        Parameters
        ----------
        time, picture
            As `update` takes them.

        Returns
        -------
        The vehicles shown in this frame, by id.
        """
