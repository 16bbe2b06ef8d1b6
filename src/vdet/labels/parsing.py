"""The limits of all files of boxes, and readers of their texts, numbers and rows."""

import codecs
import io
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path, PurePosixPath
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError

from vdet.archives import ArchiveError, list_members, open_archive, read_member
from vdet.errors import TruthError
from vdet.files import read_whole
from vdet.labels.label import Corners, Label, from_size, limited, line_error
from vdet.track.track import State

LIMIT = 10_000_000
"""Largest frame number, id or pixel coordinate. Larger numbers are damage, and would overflow."""

MAX_BYTES = 300_000_000
"""Largest size of a file of boxes, unpacked."""

MAX_PART = 1_000_000
"""Largest size of a line, in bytes."""

MAX_LINES = 10_000_000
"""Largest number of lines in a file of boxes."""

_LATEST = 1e11
"""Largest time in seconds, three thousand years of wall-clock time."""

Number = Annotated[float, Field(ge=-LIMIT, le=LIMIT, allow_inf_nan=False)]
Index = Annotated[int, Field(ge=0, le=LIMIT)]
"""Fields of JSON documents and of tables."""

Times = dict[int, tuple[int | str, float]]
"""The place in the file and the time, seconds, of each frame, counted from 0."""


def read_bytes(path: Path) -> bytes:
    """Return the content of a file. Raises `TruthError` if it is larger than `MAX_BYTES`."""
    return read_whole(path, most=MAX_BYTES, what="file of boxes", error=TruthError)


def numbered_lines(path: Path | str, data: bytes) -> Iterator[tuple[int, str]]:
    """Yield every line that is not blank, stripped, with its number from 1.

    Raises
    ------
    TruthError
        The content is not UTF-8, has more than `MAX_LINES`, or a line is longer than `MAX_PART`.
    """
    file = io.BytesIO(data)
    file.seek(len(codecs.BOM_UTF8) if data.startswith(codecs.BOM_UTF8) else 0)
    try:
        for number, line in enumerate(file, start=1):
            if len(line) > MAX_PART:
                raise line_error(path, number, f"the line is longer than {MAX_PART:,} bytes")
            if number > MAX_LINES:
                raise TruthError(f"{path}: has more than {MAX_LINES:,} lines; cut it into parts")
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
        Function that takes the number of a line and its columns, and returns the label. Its
        ValueError becomes the message.
    form
        Name of the format, for messages.
    counts
        How many columns a line may have; all lines have as many as the first. None: `parse` checks.
    separator
        Text between columns; None for spaces.

    Raises
    ------
    TruthError
        The content is not text, a line has another number of columns, or it cannot be parsed.
    """
    for line, content in numbered_lines(path, data):
        columns = content.split(separator)
        try:
            if counts is not None and len(columns) not in counts:
                wanted, between = " or ".join(map(str, counts)), "commas" if separator else "spaces"
                raise ValueError(
                    f"{form} has {wanted} columns separated by {between}; this line has "
                    f"{len(columns)}"
                )
            label = parse(line, columns)
        except ValueError as error:
            raise line_error(path, line, str(error)) from error
        counts = counts and (len(columns),)
        yield label


def parse_number(text: str) -> float:
    """Return the number in `text`. Raises ValueError if it is none, or its size exceeds `LIMIT`."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= LIMIT:
        raise ValueError(f"{text.strip()!r:.40} is not a number of at most {LIMIT}")
    return value


def parse_whole(text: str) -> int:
    """Return the whole number in `text`; `3` and `3.0` are both 3. Raises ValueError."""
    value = parse_number(text)
    if not value.is_integer():
        raise ValueError(f"{text.strip()!r:.40} is not a whole number")
    return int(value)


def parse_corners(texts: Sequence[str]) -> Corners:
    """Return left, top, right and bottom from their texts. Raises ValueError."""
    left, top, right, bottom = map(parse_number, texts)
    return left, top, right, bottom


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
            what = f"frame {frame} is at {time:g} s; times must be numbers and must not decrease"
            raise line_error(path, place, what)
        latest = time
    return {frame: time for frame, (_, time) in times.items()}


KINDS = {
    "frame": Index,
    "time": float,
    "id": Index,
    **dict.fromkeys(("x", "y", "width", "height"), Number),
    "score": Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] | None,
    "state": State | None,
    "class": str | None,
    "foot": tuple[Number, Number] | None,
    "distance": Number | None,
    "lane": Annotated[int, Field(ge=-LIMIT, le=LIMIT)] | None,
}
"""What is known of a box, in pixels; the frame and the time, seconds, come first."""
_Row: Any = tuple[(*KINDS.values(),)]  # type: ignore[misc]
_ROWS: TypeAdapter[list[Any]] = TypeAdapter(list[_Row])
_BLOCK = 300
"""Rows that are checked at once; they fit into the cache."""

Row = tuple[int | str, Sequence[Any]]
"""The place of a box in its file, and its values in the order of `KINDS`."""


def read_rows(
    path: Path, rows: Iterable[Row], times: Times | None = None, first_frame: int = 0
) -> tuple[tuple[Label, ...], dict[int, float]]:
    """Return the labels of rows, and the times of all frames.

    Parameters
    ----------
    times
        Those of frames without a box, which `rows` may fill.
    first_frame
        The number of the first frame of a video in the file.

    Raises
    ------
    TruthError
        A value is not what its column needs, there are too many rows, or a time is wrong.
    """
    times = {} if times is None else times
    return limited(path, _labels(path, rows, times, first_frame)), checked_times(path, times)


def _labels(path: Path, rows: Iterable[Row], times: Times, first_frame: int) -> Iterator[Label]:
    """Yield the label of each row, and put the time of its frame into `times`."""
    left = iter(rows)
    while block := list(islice(left, _BLOCK)):
        places, cells = zip(*block, strict=True)
        try:
            values = _ROWS.validate_python(cells)
        except ValidationError as error:
            at, column = error.errors()[0]["loc"][:2]
            what = f"{tuple(KINDS)[int(column)]}: {error.errors()[0]['msg']}"
            raise line_error(path, places[int(at)], what) from error
        for place, row in zip(places, values, strict=True):
            frame, time, id_, x, y, width, height, score, state, name, *known = row
            index, score = frame - first_frame, 1.0 if score is None else score
            times[index] = place, time
            box, number = from_size(x, y, width, height), index + 1
            yield Label(place, box, name, number, id_, score, False, state or "detected", *known)


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


def first_mistake(error: Exception) -> str:
    """Return one line that describes the first mistake in a document, and its place."""
    if not isinstance(error, ValidationError):
        return str(error)
    first = error.errors(include_url=False, include_input=False, include_context=False)[0]
    place = ".".join(str(part) for part in first["loc"])
    what = first["msg"].removeprefix("Value error, ")
    return f"{place}: {what}" if place else what
