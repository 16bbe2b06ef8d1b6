"""Detectors of any kind, loaded from settings and a model file."""

from collections.abc import Callable, Sequence
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
    """What is registered under the name of a kind of detector.

    Attributes
    ----------
    settings
        The class of its section `detector`; the default of the field `kind` is the name.
    load
        Loads it from its settings and a model file; None stands for the shipped file.
    shipped
        Returns the shipped model file for some settings; None where the kind needs no file.
    """

    settings: type[DetectorSettings]
    load: Callable[[Any, Path | None], DetectorModel]
    shipped: Callable[[Any], Path | None] = lambda _: None


def load_detector(settings: DetectorSettings) -> DetectorModel:
    """Load the detector that the settings name.

    Raises
    ------
    ConfigError
        There is no detector of that name, or the model file is for a detector of another kind.
    ModelError
        The model file cannot be used.
    """
    kind, model = None, Path(settings.model) if settings.model else None
    if model:
        from vdet.config.kinds import kind_of_model  # it imports YAML

        kind = kind_of_model(model)
    if kind and settings.model_suffix and kind != settings.kind:
        raise ConfigError(
            f"{model}: is for detector.kind: {kind}, not {settings.kind}; remove one of them"
        )
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
    """Return a detector object as one that any video can be searched with."""
    if isinstance(detector, DetectorModel):
        return detector
    return _Shared(detector if isinstance(detector, VideoDetector) else _Function(detector))


@dataclass(frozen=True, slots=True)
class _Shared:
    """A detector that is used as it is for every video."""

    detector: VideoDetector

    def for_video(self, width: int, height: int, images: Sequence[Image]) -> VideoDetector:  # noqa: ARG002
        return self.detector


@dataclass(frozen=True, slots=True)
class _Function:
    """A detector that is a function of an image."""

    find: Callable[[Image], Boxes]

    def search(self, picture: Picture, index: int | None) -> Boxes:  # noqa: ARG002
        return self.find(picture.image)

    def detect(self, candidates: Boxes) -> Boxes:
        return candidates
