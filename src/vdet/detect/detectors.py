"""Detectors: the protocol of all kinds, and how one is loaded from settings and a model file."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from vdet.boxes import Boxes, Image
from vdet.config.kinds import DetectorKind, kind_of_model
from vdet.config.schema import DetectorSettings
from vdet.errors import ConfigError
from vdet.media import Picture
from vdet.plugins import DETECTORS, load_plugin

StageImages = Callable[[Image, Boxes], dict[str, Image]]
"""Takes an image and its detections; returns an image of each stage by its name."""


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


def load_detector(settings: DetectorSettings) -> DetectorModel:
    """Load the detector that the settings name.

    Raises
    ------
    ConfigError
        The kind is unknown, or the model file is for another kind.
    ModelError
        The model file cannot be used.
    """
    kind: DetectorKind = load_plugin(DETECTORS, settings.kind)
    path = Path(settings.model) if settings.model else None
    of_model = kind_of_model(path) if path and kind.model_suffix else None
    if of_model not in (None, settings.kind):
        advice = f"is for detector.kind: {of_model}, not {settings.kind}; remove one of them"
        raise ConfigError(f"{path}: {advice}")
    model: DetectorModel = kind.load(settings, path)
    return model


def model_file(settings: DetectorSettings) -> Path | None:
    """Return the model file that `load_detector` would read; None for a detector without one."""
    kind: DetectorKind = load_plugin(DETECTORS, settings.kind)
    return Path(settings.model) if settings.model else kind.shipped(settings)


DetectorObject = DetectorModel | VideoDetector | Callable[[Image], Boxes]
"""A detector: for any video, for one video, or as a function of an image."""


def as_model(detector: DetectorObject) -> DetectorModel:
    """Return a detector object as one that can search any video."""
    return detector if isinstance(detector, DetectorModel) else _Shared(detector)


@dataclass(frozen=True, slots=True)
class _Shared:
    """A detector, or a function of an image, used unchanged for every video."""

    detector: Any

    def for_video(self, *_: object) -> VideoDetector:
        return self.detector if isinstance(self.detector, VideoDetector) else self

    def search(self, picture: Picture, index: int | None) -> Boxes:  # noqa: ARG002
        detections: Boxes = self.detector(picture.image)
        return detections

    def detect(self, candidates: Boxes) -> Boxes:
        return candidates
