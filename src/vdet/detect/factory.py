"""Detectors of any kind, loaded from settings and a model file."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vdet.boxes import Boxes, Image
from vdet.config.kinds import DetectorKind, kind_of_model
from vdet.config.schema import DetectorSettings
from vdet.detect.protocol import DetectorModel, VideoDetector
from vdet.errors import ConfigError
from vdet.media import Picture
from vdet.plugins import DETECTORS, load_plugin


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
