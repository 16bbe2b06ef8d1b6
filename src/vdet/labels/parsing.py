"""The limits of all files of boxes, and parsers of their text, lines and numbers."""

import codecs
import io
import math
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path, PurePosixPath
from typing import Annotated

from pydantic import Field, ValidationError

from vdet.errors import TruthError
from vdet.files import read_whole
from vdet.labels.label import MAX_LABELS, Label, line_error

LIMIT = 10_000_000
"""Maximum frame number, id or pixel coordinate. Larger numbers mean damage, and would overflow."""

MAX_BYTES = 300_000_000
"""Maximum size of a file of boxes, unpacked."""

MAX_PART = 1_000_000
"""Maximum size of a line, bytes."""

_LAST_NUMBER = re.compile(r"(?<![0-9])([0-9]{1,8})$", re.ASCII)
_LATEST = 1e11
"""Maximum time in seconds, three thousand years of wall-clock time."""

Number = Annotated[float, Field(ge=-LIMIT, le=LIMIT, allow_inf_nan=False)]
Index = Annotated[int, Field(ge=0, le=LIMIT)]
"""Fields of JSON documents and of tables."""

Times = dict[int, tuple[int | str, float]]
"""The position in the file and the time, seconds, of each frame, counted from 0."""


def read_bytes(path: Path) -> bytes:
    """Return the content of a file. Raises `TruthError` if it is larger than `MAX_BYTES`."""
    return read_whole(path, limit=MAX_BYTES, what="file of boxes", error=TruthError)


def numbered_lines(path: Path | str, data: bytes) -> Iterator[tuple[int, str]]:
    """Yield every line that is not blank, stripped, with its number from 1.

    Raises
    ------
    TruthError
        The content is not UTF-8, has more than `MAX_LABELS` lines, or one longer than `MAX_PART`.
    """
    try:
        for number, line in enumerate(io.BytesIO(data.removeprefix(codecs.BOM_UTF8)), start=1):
            if len(line) > MAX_PART:
                raise line_error(path, number, f"the line is longer than {MAX_PART:,} bytes")
            if number > MAX_LABELS:
                raise TruthError(f"{path}: has more than {MAX_LABELS:,} lines; cut it into parts")
            if stripped := line.decode().strip():
                yield number, stripped
    except UnicodeDecodeError as error:
        raise TruthError(f"{path}: is not text (UTF-8)") from error


def label_lines(
    path: Path | str,
    data: bytes,
    parse: Callable[[int, list[str]], Label],
    *,
    form: str,
    counts: Sequence[int] | None,
    separator: str | None = None,
) -> Iterator[Label]:
    """Yield the label of every line that is not blank.

    Parameters
    ----------
    path
        The file, for messages.
    parse
        Function that takes the number of a line and its columns, and returns the label. The text of
        its `ValueError` becomes the message.
    form
        Name of the format, for messages.
    counts
        Allowed numbers of columns; all lines have as many as the first. None: `parse` checks.
    separator
        Separator of columns; None for spaces.

    Raises
    ------
    TruthError
        The content is not text, a line has another number of columns, or it cannot be parsed.
    """
    for line, content in numbered_lines(path, data):
        columns = content.split(separator)
        try:
            if counts is not None and len(columns) not in counts:
                numbers = " or ".join(map(str, counts))
                raise ValueError(
                    f"{form} has {numbers} columns separated by "
                    f"{'commas' if separator else 'spaces'}; this line has {len(columns)}"
                )
            label = parse(line, columns)
        except ValueError as error:
            raise line_error(path, line, str(error)) from error
        counts = counts and (len(columns),)
        yield label


def parse_number(text: str) -> float:
    """Return the number in `text`. Raises `ValueError` if it is invalid or exceeds `LIMIT`."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= LIMIT:
        raise ValueError(f"{text.strip()!r:.40} is not a number of at most {LIMIT}")
    return value


def parse_whole(text: str) -> int:
    """Return the whole number in `text`; `3` and `3.0` are both 3. Raises `ValueError`."""
    value = parse_number(text)
    if not value.is_integer():
        raise ValueError(f"{text.strip()!r:.40} is not a whole number")
    return int(value)


def frame_number(name: str) -> int | None:
    """Return the frame number at the end of a file name; None without one."""
    number = _LAST_NUMBER.search(PurePosixPath(name).stem)
    return int(number[1]) if number else None


def checked_times(path: Path, times: Times) -> dict[int, float]:
    """Return the time of each frame.

    Times may be wall-clock times. The first one may be negative, as in videos.

    Raises
    ------
    TruthError
        A time is not a number, is too large, or is less than that of an earlier frame.
    """
    latest = -_LATEST
    for frame, (position, time) in sorted(times.items()):
        if not latest <= time <= _LATEST:
            message = f"frame {frame} is at {time:g} s; times must be numbers and must not decrease"
            raise line_error(path, position, message)
        latest = time
    return {frame: time for frame, (_, time) in times.items()}


def first_mistake(error: ValidationError) -> str:
    """Return one line that describes the first mistake in a document, and its position."""
    first = error.errors(include_url=False, include_input=False, include_context=False)[0]
    position = ".".join(str(part) for part in first["loc"])
    message = first["msg"].removeprefix("Value error, ")
    return f"{position}: {message}" if position else message
