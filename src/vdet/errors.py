"""Kinds of errors, each with the exit code of the program; names, numbers and times in messages.

Exit codes: 0 success, 1 an error below, 2 wrong usage (click's own), 3 some files of a batch
failed, 4 a result is doubtful and `--strict` was given, 130 interrupted.
A message is one line (a `ConfigError` may be several, one for each mistake): what is wrong, where,
and what to do about it.
"""

from fractions import Fraction

SOME_FAILED = 3
DOUBTFUL = 4
INTERRUPTED = 130
_MAX_SHOWN = 80  # characters of a name


def failure_code(failed: int, inputs: int) -> int:
    """Return the exit code of a run over several inputs, of which some or all may have failed."""
    if not failed:
        return 0
    return SOME_FAILED if failed < inputs else VdetError.exit_code


class VdetError(Exception):
    """An error that the user can understand and act upon."""

    exit_code = 1


class ConfigError(VdetError, ValueError):
    """Settings are wrong; each argument is a mistake, and a line of the message."""

    def __str__(self) -> str:
        return "\n".join(self.args)


def check_positive(**numbers: int | None) -> None:
    """Raise a `ConfigError` that names the first number below 1; None counts as not given."""
    for name, number in numbers.items():
        if number is not None and number < 1:
            raise ConfigError(f"{name}: is {number}; must be at least 1")


class DataError(VdetError, ValueError):
    """The training patches cannot be used."""


class ModelError(VdetError, ValueError):
    """A model file is damaged, is not a model, or does not fit its use."""


class ImageError(VdetError, ValueError):
    """A picture cannot be read, or searched."""


class FrameSizeError(ImageError):
    """Frames or pictures of this size are too small to be searched."""


class VideoError(VdetError, OSError):
    """A video cannot be read or written."""


class OutputError(VdetError, OSError):
    """An output cannot be written, or is already there."""


class TruthError(VdetError, ValueError):
    """A file of labelled boxes, truth or tracks, cannot be used."""


class BatchError(VdetError, ValueError):
    """A batch cannot be run as it was asked for."""


class ClusterError(VdetError, OSError):
    """A cluster cannot be used."""


_NO_ROOM = "failed to map segment"  # says the system, of a library for which memory is missing


def in_one_line(error: Exception) -> str:
    """Describe any error in one line; all but a `VdetError` and an `OSError` are called a bug."""
    if isinstance(error, VdetError):
        return str(error)
    if isinstance(error, OSError):
        return f"{error.filename or 'reading or writing'}: {error.strerror or error}"
    if isinstance(error, MemoryError) or _NO_ROOM in str(error):
        return "out of memory; close other programs, or raise the limit (ulimit -v)"
    if fault := opencv_fault():
        return fault
    text = " ".join(f"{type(error).__name__}: {error}".split())
    return f"internal error, please report it ({text}); VDET_DEBUG=1 shows more"


def opencv_fault() -> str | None:
    """Return what is wrong if another package has replaced or removed the OpenCV that vdet needs.

    Both packages of OpenCV write into one folder: the later one wins, and removing it breaks both.
    """
    try:
        import cv2
    except ImportError:
        version = "missing"
    else:
        if hasattr(cv2, "HOGDescriptor"):
            return None
        version = getattr(cv2, "__version__", "damaged")
    return (
        f"OpenCV is {version}: opencv-python has replaced opencv-python-headless; run "
        '"pip uninstall -y opencv-python opencv-python-headless" and then '
        "\"pip install 'opencv-python-headless<5'\""
    )


def escaped(text: str) -> str:
    """Return text on one line, without characters that control a terminal."""
    return "".join(char if char.isprintable() else ascii(char)[1:-1] for char in text)


def printable(name: str) -> str:
    """Return a name from outside as messages show it: escaped, and cut where it is very long."""
    shown = escaped(name)
    return shown if len(shown) <= _MAX_SHOWN else f"{shown[:_MAX_SHOWN]}…"


def counted(count: int, noun: str) -> str:
    """Return `1 car`, `6 buses`."""
    return f"{count:,} {named(count, noun)}"


def named(count: int, noun: str) -> str:
    """Return the noun for a number of things: `car`, `cars`, `buses`."""
    return noun if count == 1 else noun + ("es" if noun.endswith(("s", "x", "ch")) else "s")


def clock(seconds: float | Fraction, digits: int = 0, *, hours: bool = False) -> str:
    """Return a time as `1:05`, or `2:01:05`; always as this with `hours`, and with decimals."""
    whole, part = divmod(round(abs(seconds) * 10**digits), 10**digits)
    minutes, rest = divmod(whole, 60)
    text = f"{minutes // 60}:{minutes % 60:02}" if hours or minutes >= 60 else f"{minutes}"
    text += f":{rest:02}" + (f".{part:0{digits}}" if digits else "")
    return f"−{text}" if seconds < 0 and (whole or part) else text
