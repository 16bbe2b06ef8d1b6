"""Combinations of settings to compare: `tracker.needed=0.1,0.2` gives an assignment per value."""

import itertools
from collections.abc import Sequence

from vdet.errors import ConfigError

_OPENING, _CLOSING = "[{", "]}"


def grid(sweeps: Sequence[str]) -> list[tuple[str, ...]]:
    """Return every combination of the values, each as assignments for `load_settings`.

    Parameters
    ----------
    sweeps
        `KEY=VALUE,VALUE…` each. A comma inside brackets belongs to its value.

    Returns
    -------
    The combinations in the order of the values; the last key changes fastest. A single empty
    combination if there are no sweeps.

    Raises
    ------
    ConfigError
        There is no `=`, a value is empty, or a key is swept twice.
    """
    axes = [_axis(text) for text in sweeps]
    keys = [axis[0].partition("=")[0] for axis in axes]
    for key in keys:
        if keys.count(key) > 1:
            raise ConfigError(f"--sweep {key}: is given twice; put all its values in one")
    return list(itertools.product(*axes))


def _axis(text: str) -> list[str]:
    key, equals, values = (part.strip() for part in text.partition("="))
    found = [value.strip() for value in _split(values)]
    if not (key and equals and all(found)):
        raise ConfigError(f"--sweep {text}: expected KEY=VALUE,VALUE, as in tracker.needed=0.1,0.2")
    return [f"{key}={value}" for value in dict.fromkeys(found)]


def _split(values: str) -> list[str]:
    """Split at the commas outside brackets."""
    parts, depth = [""], 0
    for letter in values:
        depth += (letter in _OPENING) - (letter in _CLOSING)
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return parts
