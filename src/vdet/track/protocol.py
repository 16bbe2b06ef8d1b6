"""What the rest of the program knows of a tracker."""

from typing import Protocol

from vdet.detect.detections import Detections
from vdet.media.images import Image
from vdet.track.track import Track


class VideoTracker(Protocol):
    """Follows the vehicles of one video; a new one is made for every video."""

    def update(
        self, detections: Detections, time: float, image: Image | None = None
    ) -> list[Track]:
        """Follow the vehicles into the next frame.

        Parameters
        ----------
        detections
            What the detector sees in the frame.
        time
            When the frame is shown, seconds; it increases from frame to frame.
        image
            The frame, BGR uint8 `(H, W, 3)`; only trackers that look at pixels need it.

        Returns
        -------
        The vehicles shown in this frame, by id.

        Raises
        ------
        ValueError
            The tracker looks at pixels, and `image` is None.
        """
