"""The limits of all files of boxes, and parsers of their lines, times and mistakes."""

import codecs
import io
import re
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Annotated

from pydantic import Field, ValidationError

from vdet.errors import TruthError
from vdet.files import read_whole
from vdet.labels.label import line_error

LIMIT = 10_000_000
"""Maximum frame number, id or pixel coordinate. Larger numbers mean damage, and would overflow."""

MAX_BYTES = 300_000_000
"""Maximum size of a file of boxes, unpacked."""

_LAST_NUMBER = re.compile(r"(?<![0-9])([0-9]{1,8})$", re.ASCII)
_LATEST = 1e11
"""Maximum time in seconds, three thousand years of wall-clock time."""
_MAX_RATE = 10_000
"""Maximum frames per second on average; times in days have more."""

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
        The content is not UTF-8.
    """
    try:
        for number, line in enumerate(io.BytesIO(data.removeprefix(codecs.BOM_UTF8)), start=1):
            if stripped := line.decode().strip():
                yield number, stripped
    except UnicodeDecodeError as error:
        raise TruthError(f"{path}: is not a text file (UTF-8) of tracks or labels") from error


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
        A time is not a number, is too large, is less than that of an earlier frame, or cannot be
        in seconds.
    """
    latest = -_LATEST
    ordered = sorted(times.items())
    for frame, (position, time) in ordered:
        if not latest <= time <= _LATEST:
            message = f"frame {frame} is at {time:g} s; times must be numbers and must not decrease"
            raise line_error(path, position, message)
        latest = time
    if ordered and (ordered[-1][0] - ordered[0][0]) > _MAX_RATE * (latest - ordered[0][1][1]):
        fault = f"more than {_MAX_RATE:,} frames a second; times must be seconds"
        raise line_error(path, ordered[-1][1][0], fault)
    return {frame: time for frame, (_, time) in times.items()}


def first_mistake(error: ValidationError) -> str:
    """Return one line that describes the first mistake in a document, and its position."""
    first = error.errors(include_url=False, include_input=False, include_context=False)[0]
    position = ".".join(str(part) for part in first["loc"])
    message = first["msg"].removeprefix("Value error, ")
    return f"{position}: {message}" if position else message
