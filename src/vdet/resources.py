"""What ships with the program: its model and its configs."""

from pathlib import Path

from vdet.errors import ConfigError

_PACKAGE = Path(__file__).parent
# In a wheel the configs lie in the package; in a work tree beside `src`.
_CONFIGS = (_PACKAGE / "configs", _PACKAGE.parents[1] / "configs")


def shipped_model() -> Path:
    """Return the model that is used where none is given."""
    return _PACKAGE / "models" / "seed.npz"


def find_config(name: str) -> Path:
    """Return the config file at the path `name`, or else the shipped one of that name (`seed`).

    Raises
    ------
    ConfigError
        There is neither.
    """
    path = Path(name)
    if path.exists():
        return path
    shipped = {file.stem: file for folder in _CONFIGS for file in sorted(folder.glob("*.yaml"))}
    if name in shipped:
        return shipped[name]
    raise ConfigError(f"{name}: no such file; shipped configs are: {', '.join(shipped)}")
