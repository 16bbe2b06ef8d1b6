"""What the rest of the program knows of a detector."""

from collections.abc import Sequence
from typing import Any, Protocol

from vdet.detect.detections import Detections
from vdet.media.images import Image


class VideoDetector(Protocol):
    """Finds vehicles in the frames of one video, or in one still picture.

    A frame passes two steps: `search` in parallel with other frames, then `detect` in the order of
    the frames.
    """

    def search(self, image: Image, index: int | None) -> Any:
        """Return the candidates of a frame; called by several threads at once, in any order.

        Parameters
        ----------
        image
            BGR uint8 `(H, W, 3)`.
        index
            Number of the frame in its video, from 0; None for a still picture.
        """

    def detect(self, candidates: Any) -> Detections:
        """Return the detections of the next frame; called in the order of the frames.

        May remember what it needs of the frames before.
        """

    def stage_pictures(self, image: Image, detections: Detections) -> dict[str, Image]:
        """Return a picture of each stage of the detection of a frame, by name, the first one first.

        `detections` is what `detect` returned for this `image`.
        """


class DetectorModel(Protocol):
    """What is loaded once, from settings and a model file; may be shared by threads."""

    def for_video(self, width: int, height: int, images: Sequence[Image]) -> VideoDetector:
        """Return a detector for the frames of one video, or for one still picture.

        Parameters
        ----------
        width, height
            Size of the frames, pixels.
        images
            The first few frames, BGR uint8 `(H, W, 3)`; the still picture alone.

        Raises
        ------
        FrameSizeError
            Frames of this size are too small to be searched.
        """
