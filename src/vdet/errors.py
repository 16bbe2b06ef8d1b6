"""What can go wrong, by kind; each kind carries the exit code of the program.

Exit codes: 0 success, 1 an error below, 2 wrong usage (click's own), 130 interrupted.
A message is one line (a `ConfigError` may be several, one for each mistake): what is wrong, where,
and what to do about it.
"""


class VdetError(Exception):
    """Anything that the user can understand and act upon."""

    exit_code = 1


class ConfigError(VdetError, ValueError):
    """The YAML or a `--set` is wrong; one line a mistake."""


class DataError(VdetError, ValueError):
    """The training patches cannot be used."""


class ModelError(VdetError, ValueError):
    """A model file is damaged, foreign, or does not fit its use."""


class ImageError(VdetError, ValueError):
    """A picture cannot be read, or searched."""


class VideoError(VdetError, OSError):
    """A video cannot be read or written."""


class OutputError(VdetError, OSError):
    """An output cannot be written, or is already there."""


class TruthError(VdetError, ValueError):
    """A file of labelled boxes, truth or tracks, cannot be used."""
