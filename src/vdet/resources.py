"""What ships with the program: its model and its configs."""

from pathlib import Path

from vdet.config.schema import FeatureSettings
from vdet.detect.svm.model import load_model
from vdet.errors import ConfigError, ModelError

_PACKAGE = Path(__file__).parent
# In a wheel the configs lie in the package; in a work tree beside `src`.
_CONFIGS = (_PACKAGE / "configs", _PACKAGE.parents[1] / "configs")


def shipped_model(features: FeatureSettings) -> Path:
    """Return the shipped model that was trained with these features.

    Raises
    ------
    ModelError
        There is none.
    """
    models = sorted((_PACKAGE / "models").glob("*.npz"))
    for path in models:
        if load_model(path).features == features:
            return path
    raise ModelError(
        "no shipped model was trained with the features in the settings; give --model, or train "
        "one with these settings"
    )


def find_config(name: str) -> Path:
    """Return the config file at the path `name`, or else the shipped one of that name (`seed`).

    Raises
    ------
    ConfigError
        There is neither.
    """
    path = Path(name)
    if path.is_file():
        return path
    shipped = {file.stem: file for folder in _CONFIGS for file in sorted(folder.glob("*.yaml"))}
    if name in shipped:
        return shipped[name]
    raise ConfigError(f"{name}: no such file; shipped configs are: {', '.join(shipped)}")
