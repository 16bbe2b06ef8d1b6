"""A detector from settings and a model file, whatever its kind."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vdet.config.schema import DetectorSettings
from vdet.detect.protocol import DetectorModel
from vdet.plugins import DETECTORS, load_plugin


def _no_model(_: Any) -> None:
    """Say that a kind needs no model file."""


@dataclass(frozen=True, slots=True)
class DetectorKind:
    """A kind of detector, as it is registered under its name.

    Attributes
    ----------
    settings
        Class of the section `detector` for this kind; its `kind` has the name as default.
    load
        Takes these settings and the path of a model file, None for the shipped one.
    shipped
        Returns the shipped model file for some settings; None where the kind needs no file.
    """

    settings: type[DetectorSettings]
    load: Callable[[Any, Path | None], DetectorModel]
    shipped: Callable[[Any], Path | None] = _no_model


def load_detector(settings: DetectorSettings, model: Path | None = None) -> DetectorModel:
    """Load the detector that the settings name; `model` is a file, None for the shipped one.

    Raises
    ------
    ConfigError
        There is no detector of that name.
    ModelError
        The model file cannot be used.
    """
    return _kind(settings).load(settings, model)


def model_file(settings: DetectorSettings, model: Path | None = None) -> Path | None:
    """Return the model file that `load_detector` would read; None for a detector without one."""
    return model or _kind(settings).shipped(settings)


def _kind(settings: DetectorSettings) -> DetectorKind:
    kind: DetectorKind = load_plugin(DETECTORS, settings.kind)
    return kind
