"""Detectors of any kind, loaded from settings and a model file."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vdet.boxes import Boxes, Image
from vdet.config.schema import DetectorSettings
from vdet.detect.protocol import DetectorModel, VideoDetector
from vdet.errors import ConfigError
from vdet.media import Picture
from vdet.plugins import DETECTORS, load_plugin


@dataclass(frozen=True, slots=True)
class DetectorKind:
    """A kind of detector, as registered under its name.

    Attributes
    ----------
    settings
        Class of the section `detector` for this kind; the default of its `kind` is the name.
    load
        Loads the detector from its settings and a model file, None for the shipped one.
    shipped
        Returns the shipped model file for given settings; None if the kind needs no file.
    """

    settings: type[DetectorSettings]
    load: Callable[[Any, Path | None], DetectorModel]
    shipped: Callable[[Any], Path | None] = lambda _: None


def load_detector(settings: DetectorSettings) -> DetectorModel:
    """Load the detector that the settings name.

    Raises
    ------
    ConfigError
        The kind is unknown, or the model file is for another kind.
    ModelError
        The model file cannot be used.
    """
    model = Path(settings.model) if settings.model else None
    if model and settings.model_suffix:
        from vdet.config.kinds import kind_of_model  # it imports YAML

        if (kind := kind_of_model(model)) not in (None, settings.kind):
            advice = f"is for detector.kind: {kind}, not {settings.kind}; remove one of them"
            raise ConfigError(f"{model}: {advice}")
    return _kind(settings).load(settings, model)


def model_file(settings: DetectorSettings) -> Path | None:
    """Return the model file that `load_detector` would read; None for a detector without one."""
    return Path(settings.model) if settings.model else _kind(settings).shipped(settings)


def _kind(settings: DetectorSettings) -> DetectorKind:
    kind: DetectorKind = load_plugin(DETECTORS, settings.kind)
    return kind


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
        found: Boxes = self.detector(picture.image)
        return found

    def detect(self, candidates: Boxes) -> Boxes:
        return candidates
