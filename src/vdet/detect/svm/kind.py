"""The linear model as the kind of detector `svm`: its model files, and how it is loaded."""

from pathlib import Path

from vdet.config.detector import FeatureSettings
from vdet.config.schema import SvmSettings
from vdet.detect.factory import DetectorKind
from vdet.detect.svm.detector import SvmModel
from vdet.detect.svm.model import load_model
from vdet.errors import ModelError

_MODELS = Path(__file__).parents[2] / "models"


def shipped_model(settings: SvmSettings) -> Path:
    """Return the shipped model that was trained with the features in the settings.

    Raises
    ------
    ModelError
        There is none.
    """
    for path in sorted(_MODELS.glob("*.npz")):
        if load_model(path).features == settings.features:
            return path
    raise ModelError("no shipped model has these features; pass --model, or train one")


def load_svm(settings: SvmSettings, path: Path | None) -> SvmModel:
    """Load a linear model; `path` is its file, None for the shipped one.

    Features that the settings give must be those that the model was trained with. Where they give
    none, the model's own are used.

    Raises
    ------
    ModelError
        The file cannot be used, or the model was trained with other features.
    """
    model = load_model(path or shipped_model(settings), requested_features(settings))
    return SvmModel(model, settings)


def requested_features(settings: SvmSettings) -> FeatureSettings | None:
    """Return the features that a model must have; None where the settings give none."""
    return settings.features if "features" in settings.model_fields_set else None


def trained_on(path: Path) -> tuple[str, ...]:
    """Return the names of the groups of patches that a linear model was trained on."""
    try:
        groups = load_model(path).provenance["report"]["groups"]
        return tuple(dict.fromkeys(str(group).rpartition("/")[2] for group in groups))
    except (LookupError, TypeError):
        return ()


SVM = DetectorKind(SvmSettings, load_svm, shipped_model, trained_on)
