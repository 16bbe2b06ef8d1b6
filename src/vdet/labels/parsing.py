"""The limits of all files of boxes, and strict readers of their texts and numbers."""

import codecs
import io
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path, PurePosixPath
from typing import Annotated, TextIO

from pydantic import Field, ValidationError

from vdet.archives import ArchiveError, list_members, open_archive, read_member
from vdet.errors import TruthError
from vdet.files import read_whole
from vdet.labels.label import Label, line_error

LIMIT = 10_000_000
"""Largest frame number, id or pixel coordinate. Larger numbers are damage, and would overflow."""

MAX_BYTES = 300_000_000
"""Largest size of a file of boxes, unpacked."""

MAX_PART = 1_000_000
"""Bytes that a line, an XML tag, or an object of a JSON list of tracks may always have; no text has
twice as many."""

MAX_LINES = 10_000_000
"""Largest number of lines in a file of boxes."""

_LATEST = 1e11
"""Largest time in seconds, three thousand years of wall-clock time."""

Number = Annotated[float, Field(ge=-LIMIT, le=LIMIT, allow_inf_nan=False)]
Index = Annotated[int, Field(ge=0, le=LIMIT)]
"""Fields of JSON documents and of tables."""

Times = dict[int, tuple[int | str, float]]
"""The place in the file and the time, seconds, of each frame, counted from 0."""

_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)


def read_bytes(path: Path) -> bytes:
    """Return the content of a file. Raises `TruthError` if it is larger than `MAX_BYTES`."""
    return read_whole(path, most=MAX_BYTES, what="file of boxes", error=TruthError)


def check_parts(path: Path, data: bytes, what: str, ends: Sequence[bytes]) -> None:
    """Refuse UTF-8 with a part of more than twice `MAX_PART` bytes before one of its `ends`.

    Raises
    ------
    TruthError
        There is such a part, or the content is not text.
    """
    decode = codecs.getincrementaldecoder("utf-8")().decode
    for start in range(0, len(data), MAX_PART):
        part = data[start : start + MAX_PART]
        try:
            decode(part, start + MAX_PART >= len(data))
        except UnicodeDecodeError:
            part = b"\0"
        if b"\0" in part:
            raise TruthError(f"{path}: is not text (UTF-8); give a file of boxes")
        if len(part) == MAX_PART and not any(end in part for end in ends):
            line = data.count(b"\n", 0, start) + 1
            raise line_error(path, line, f"{what} is longer than {MAX_PART:,} bytes")


def text_file(path: Path, data: bytes, newline: str | None = None) -> TextIO:
    """Return the content of a file as a file of text, whose memory is that of `data`.

    Raises
    ------
    TruthError
        It is not UTF-8, has more than `MAX_LINES`, or one that is too long.
    """
    check_parts(path, data, "the line", (b"\n", b"\r"))
    if max(data.count(b"\n"), data.count(b"\r")) > MAX_LINES:
        raise TruthError(f"{path}: has more than {MAX_LINES:,} lines; cut it into parts")
    return io.TextIOWrapper(io.BytesIO(data), "utf-8-sig", newline=newline)


def numbered_lines(path: Path, data: bytes) -> Iterator[tuple[int, str]]:
    """Yield every line that is not blank, stripped, with its number from 1; errors as above."""
    for number, line in enumerate(text_file(path, data), start=1):
        if stripped := line.strip():
            yield number, stripped


def label_lines(
    path: Path,
    data: bytes,
    parse: Callable[[int | str, list[str]], Label],
    *,
    form: str,
    counts: Sequence[int] | None,
    separator: str | None = None,
    member: str = "",
) -> Iterator[Label]:
    """Yield the label of every line that is not blank.

    Parameters
    ----------
    parse
        Function that takes the place of a line and its columns, and returns the label. Its
        ValueError becomes the message.
    form
        Name of the format, for messages.
    counts
        How many columns a line may have; all lines have as many as the first. None: `parse` checks.
    separator
        Text between columns; None for spaces.
    member
        Name of the file in the archive `path`; empty if the content is that of `path`.

    Raises
    ------
    TruthError
        The content is not text, a line has another number of columns, or it cannot be parsed.
    """
    for line, content in numbered_lines(path, data):
        columns = content.split(separator)
        place: int | str = f"{member}:{line}" if member else line
        if counts is not None and len(columns) not in counts:
            wanted = " or ".join(map(str, counts))
            between = "commas" if separator else "spaces"
            what = f"{form} has {wanted} columns between {between}; this line has {len(columns)}"
            raise line_error(path, place, what)
        counts = counts and (len(columns),)
        try:
            label = parse(place, columns)
        except ValueError as error:
            raise line_error(path, place, str(error)) from error
        yield label


def parse_number(text: str) -> float:
    """Return the decimal number in `text`.

    Raises
    ------
    ValueError
        The text is not a decimal number (words, NaN, infinity), or the number is beyond `LIMIT`.
    """
    stripped = text.strip()
    if not _NUMBER.fullmatch(stripped):
        raise ValueError(f"{stripped!r:.40} is not a number")
    value = float(stripped)
    if abs(value) > LIMIT:
        raise ValueError(f"{stripped!r:.40} is beyond {LIMIT}")
    return value


def parse_whole(text: str) -> int:
    """Return the whole number in `text`; `3` and `3.0` are both 3.

    Raises
    ------
    ValueError
        The text is not a whole number, or the number is beyond `LIMIT`.
    """
    value = parse_number(text)
    if not value.is_integer():
        raise ValueError(f"{text.strip()!r:.40} is not a whole number")
    return int(value)


def checked_times(path: Path, times: Times) -> dict[int, float]:
    """Return the time of each frame.

    Times may be those of a wall clock. The first one may be negative, as in videos.

    Raises
    ------
    TruthError
        A time is not a number or is too large, or is less than that of an earlier frame.
    """
    latest = -_LATEST
    for frame, (place, time) in sorted(times.items()):
        if not latest <= time <= _LATEST:
            what = f"frame {frame} is at {time:g} s; times must be numbers that do not fall"
            raise line_error(path, place, what)
        latest = time
    return {frame: time for frame, (_, time) in times.items()}


def archive_members(
    path: Path, data: bytes, is_wanted: Callable[[PurePosixPath], bool]
) -> dict[str, bytes]:
    """Return the members of a zip file that are wanted, by their names.

    Raises
    ------
    TruthError
        The archive is damaged, a name in it leads out of it, or the members are larger than
        `MAX_BYTES` together.
    """
    try:
        names = [name for name in list_members(io.BytesIO(data)) if is_wanted(PurePosixPath(name))]
        with open_archive(io.BytesIO(data)) as archive:
            if sum(archive.getinfo(name).file_size for name in names) > MAX_BYTES:
                what = f"its labels are larger than {MAX_BYTES:,} bytes; cut the video into parts"
                raise ArchiveError(what)
            return {name: read_member(archive, name, most=MAX_BYTES) for name in names}
    except ArchiveError as error:
        raise TruthError(f"{path}: {error}") from error


def first_mistake(error: ValueError) -> str:
    """Return one line that describes the first mistake in a document, and its place."""
    if not isinstance(error, ValidationError):
        return str(error)
    first = error.errors(include_url=False, include_input=False, include_context=False)[0]
    place = ".".join(str(part) for part in first["loc"])
    what = first["msg"].removeprefix("Value error, ")
    return f"{place}: {what}" if place else what
