"""The errors and their exit codes; how messages write names, numbers and times.

Exit codes: 0 success, 1 an error below, 2 wrong usage (from click), 3 some files of a batch failed,
4 a result is doubtful and `--strict` is set, 130 interrupted.
A message is one line (a `ConfigError` has one for each mistake): what is wrong, where, and what to
do.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from fractions import Fraction

SOME_FAILED = 3
DOUBTFUL = 4
INTERRUPTED = 130
_MAX_SHOWN = 80  # characters of a name


def failure_code(failed: int, inputs: int) -> int:
    """Return the exit code of a run over several inputs, given how many have failed."""
    if not failed:
        return 0
    return SOME_FAILED if failed < inputs else VdetError.exit_code


_PARAMETERS = {
    "overwrite": "use overwrite=True to replace it",
    "skip_existing": "use overwrite=True to replace it, or skip_existing=True to keep it",
    "rate": "pass the frame rate, as in rate=25",
    "size": "pass the size of the frames, as in size=(1280, 720)",
}
"""How a parameter fixes an error in Python, by the `field` of the error."""

_OPTIONS = {
    "overwrite": "use --overwrite to replace it",
    "skip_existing": "use --overwrite to replace it, or --skip-existing to keep it",
    "rate": "pass the frame rate, as in --rate 25",
    "size": "pass the size of the frames, as in --size 1280x720",
}
"""The same for the options of the command line."""


class VdetError(Exception):
    """An error that the user can understand and fix.

    Its text is for Python, that of `in_one_line` for the command line. `field` is the parameter or
    option that fixes it; None if the message already says what to do.
    """

    exit_code = 1

    def __init__(self, *lines: object, field: str | None = None) -> None:
        super().__init__(*lines)
        self.field = field

    def __str__(self) -> str:
        return self.text(_PARAMETERS)

    def text(self, advice: Mapping[str, str]) -> str:
        """Return its lines, and what to do, by `field`."""
        lines = "\n".join(map(str, self.args))
        return f"{lines}; {advice[self.field]}" if self.field else lines


class ConfigError(VdetError, ValueError):
    """Settings are wrong; each argument is one mistake, and one line of the message."""


class ArgumentError(VdetError, ValueError):
    """An argument from Python has a wrong value."""


class ArgumentTypeError(VdetError, TypeError):
    """An argument from Python has a wrong type."""


class PackageError(VdetError, ImportError):
    """A package that only some features need is not installed."""


@contextmanager
def needing(extra: str) -> Iterator[None]:
    """Raise a `PackageError` that names this extra of vdet, if an import in the block fails.

    The command installs the package itself: vdet is on no index, where others could take its name.
    """
    try:
        yield
    except ImportError as error:
        name = str(error.name).partition(".")[0]
        advice = f'pip install {name}, or vdet with its extra "{extra}"'
        raise PackageError(f"{name} is not installed; {advice}") from error


class DataError(VdetError, ValueError):
    """The training patches cannot be used."""


class ModelError(VdetError, ValueError):
    """A model file is damaged, is not a model, or cannot be used here."""


class ImageError(VdetError, ValueError):
    """An image cannot be read or searched."""


class FrameSizeError(ImageError):
    """Frames or images of this size are too small to search."""


class VideoError(VdetError, OSError):
    """A video cannot be read or written."""


class OutputError(VdetError, OSError):
    """An output cannot be written, or already exists."""


class TruthError(VdetError, ValueError):
    """A file of labelled boxes, ground truth or tracks, cannot be used."""


class BatchError(VdetError, ValueError):
    """A batch cannot be run with these inputs and outputs, or on this cluster."""


_NO_MEMORY = "failed to map segment"  # the system, when there is no memory to load a library


def in_one_line(error: Exception) -> str:
    """Describe any error in one line; anything but a `VdetError` or an `OSError` is a bug."""
    if isinstance(error, VdetError):
        return error.text(_OPTIONS)
    if isinstance(error, OSError):
        return f"{error.filename or 'reading or writing'}: {error.strerror or error}"
    if isinstance(error, MemoryError) or _NO_MEMORY in str(error):
        return "out of memory; close other programs, or raise the limit (ulimit -v)"
    text = " ".join(f"{type(error).__name__}: {error}".split())
    return f"internal error, please report it ({text}); VDET_DEBUG=1 shows more"


def escaped(text: str) -> str:
    """Return text on one line, without characters that control a terminal."""
    return "".join(char if char.isprintable() else ascii(char)[1:-1] for char in text)


def printable(name: str) -> str:
    """Return a name from outside for messages: escaped, and truncated if it is very long."""
    shown = escaped(name)
    return shown if len(shown) <= _MAX_SHOWN else f"{shown[:_MAX_SHOWN]}…"


def quantity(count: int, noun: str) -> str:
    """Return `1 car`, `6 buses`, `2 people`."""
    return f"{count:,} {plural(count, noun)}"


def plural(count: int, noun: str) -> str:
    """Return the noun for a number of things: `car`, `cars`, `buses`, `lorries`, `people`."""
    if count == 1:
        return noun
    if noun.endswith("person"):
        return noun.removesuffix("person") + "people"
    if noun.endswith("y") and noun[-2:-1] not in "aeiou":
        return noun[:-1] + "ies"
    return noun + ("es" if noun.endswith(("s", "x", "ch", "sh")) else "s")


def clock_text(seconds: float | Fraction, digits: int = 0, *, hours: bool = False) -> str:
    """Return a time as `1:05`, or `2:01:05` for hours; `digits` is the number of decimals."""
    whole, part = divmod(round(abs(seconds) * 10**digits), 10**digits)
    minutes, whole_seconds = divmod(whole, 60)
    text = f"{minutes // 60}:{minutes % 60:02}" if hours or minutes >= 60 else f"{minutes}"
    text += f":{whole_seconds:02}" + (f".{part:0{digits}}" if digits else "")
    return f"−{text}" if seconds < 0 and (whole or part) else text
