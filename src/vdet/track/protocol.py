"""The protocol of all trackers; the rest of the program uses nothing else of them."""

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

    `vdet.track.factory.make_tracker` adds `carry` to a tracker without it; vehicles then stay where
    they were.
    """

    def carry(self, time: float, picture: Picture | None = None) -> list[Track]:
        """Follow the vehicles into the next frame, which was not searched.

        This frame does not count as a missed one for any vehicle. All tracks are `predicted`.

        Parameters
        ----------
        time, picture
            As `update` takes them.

        Returns
        -------
        The vehicles shown in this frame, by id.
        """
