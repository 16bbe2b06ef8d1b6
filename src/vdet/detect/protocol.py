"""The protocol of all detectors; the rest of the program uses only this."""

from collections.abc import Callable, Sequence
from typing import Any, Protocol, runtime_checkable

from vdet.boxes import Boxes, Image
from vdet.media import Picture


@runtime_checkable
class VideoDetector(Protocol):
    """Finds vehicles in the frames of one video, or in one single image.

    Each frame takes two steps: `search`, in parallel with other frames, then `detect`, in the order
    of the frames. The attribute `is_stateless`, if present and true, means that `detect` keeps
    nothing: threads call it after `search`, and fewer frames are searched where nothing moves.
    """

    def search(self, picture: Picture, index: int | None) -> Any:
        """Return the candidates in a frame; several threads call this at once, in any order.

        Parameters
        ----------
        picture
            The frame: `image` is BGR, `planes` are those of the decoder, or None.
        index
            Number of the frame in its video, from 0; None for a single image. The settings
            `searches_per_second` and `stride` decide which frames are searched.
        """

    def detect(self, candidates: Any) -> Boxes:
        """Return the detections of the next frame, from what `search` returned for it.

        Unless the detector is stateless, it is called in the order of the frames, and may remember
        earlier ones.
        """


StageImages = Callable[[Image, Boxes], dict[str, Image]]
"""Takes an image and its detections; returns an image of each stage by its name."""


def stage_images_of(detector: VideoDetector) -> StageImages:
    """Return the method `stage_images` of a detector, or one that returns no images."""
    return getattr(detector, "stage_images", lambda *_: {})


def warnings_of(model: "DetectorModel") -> list[str]:
    """Return what a model says of its results, after a run: its method `warnings`, if present."""
    warnings: list[str] = getattr(model, "warnings", list)()
    return warnings


@runtime_checkable
class DetectorModel(Protocol):
    """A detector loaded from settings and a model file; threads may share it."""

    def for_video(self, width: int, height: int, images: Sequence[Image]) -> VideoDetector:
        """Return a detector for the frames of one video, or for one single image.

        Parameters
        ----------
        width, height
            Size of the frames, pixels.
        images
            The first few frames, or the single image, BGR uint8 `(H, W, 3)`; frames of a video are
            converted when they are first used.

        Raises
        ------
        FrameSizeError
            Frames of this size are too small to search.
        """
