"""The protocol of all detectors; the rest of the program uses nothing else of them."""

from collections.abc import Callable, Sequence
from typing import Any, Protocol, runtime_checkable

from vdet.boxes import Boxes, Image
from vdet.media import Picture


@runtime_checkable
class VideoDetector(Protocol):
    """Finds vehicles in the frames of one video, or in one still picture.

    Each frame takes two steps: `search`, in parallel with other frames, then `detect`, in the order
    of the frames.
    """

    def search(self, picture: Picture, index: int | None) -> Any:
        """Return the candidates of a frame; several threads call this at once, in any order.

        Parameters
        ----------
        picture
            The frame; its `image` is BGR, its `planes` are those of the decoder, if there are any.
        index
            Number of the frame in its video, from 0; None for a still picture. The settings
            `searches` and `stride` say which frames are searched.
        """

    def detect(self, candidates: Any) -> Boxes:
        """Return the detections of the next frame, from what `search` returned for it.

        It is called in the order of the frames, and may keep what it needs of earlier ones.
        """


StagePictures = Callable[[Image, Boxes], dict[str, Image]]
"""Takes an image and what `detect` returned for it; returns a picture of each stage by its name."""


def stage_pictures_of(detector: VideoDetector) -> StagePictures:
    """Return the method `stage_pictures` of a detector, if it has one."""
    return getattr(detector, "stage_pictures", lambda *_: {})


@runtime_checkable
class DetectorModel(Protocol):
    """A detector as it is loaded from settings and a model file; threads may share it."""

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
