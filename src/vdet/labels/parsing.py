"""Text files and the numbers in them, read strictly."""

import io
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Annotated

from pydantic import Field, ValidationError

from vdet.errors import TruthError
from vdet.files import read_whole
from vdet.labels.label import Label, line_error

LIMIT = 10_000_000
"""Largest frame number, id or pixel. A larger number is damage, and would overflow later."""

MAX_BYTES = 64_000_000
"""Largest size of a file of boxes."""

Number = Annotated[float, Field(ge=-LIMIT, le=LIMIT, allow_inf_nan=False)]
Index = Annotated[int, Field(ge=0, le=LIMIT)]
"""Fields of JSON documents and of tables."""

_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)


def read_bytes(path: Path) -> bytes:
    """Return the content of a file. Raises `TruthError` if it is larger than `MAX_BYTES`."""
    return read_whole(path, most=MAX_BYTES, what="file of boxes", error=TruthError)


def text_of(path: Path, data: bytes) -> str:
    """Return the text of the content of a file. Raises `TruthError` if it is not UTF-8."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise TruthError(f"{path}: is not text (UTF-8); give a file of boxes") from error
    if "\0" in text:
        raise TruthError(f"{path}: is not text (UTF-8); give a file of boxes")
    return text


def read_text(path: Path) -> str:
    """Return the text of a UTF-8 file.

    Raises
    ------
    TruthError
        The file cannot be read, is larger than `MAX_BYTES` or is not text.
    """
    return text_of(path, read_bytes(path))


def numbered_lines(text: str) -> Iterator[tuple[int, str]]:
    """Yield every line that is not blank, stripped, with its number from 1."""
    for number, line in enumerate(io.StringIO(text, newline=None), start=1):
        if stripped := line.strip():
            yield number, stripped


def label_lines(
    path: Path,
    text: str,
    parse: Callable[[int | str, list[str]], Label],
    *,
    form: str,
    counts: Sequence[int],
    separator: str | None = None,
    member: str = "",
) -> Iterator[Label]:
    """Yield the label of every line that is not blank.

    Parameters
    ----------
    parse
        Function that takes the place of a line and its columns and returns the label. It raises a
        ValueError that says what is wrong.
    form
        Name of the format, for messages.
    counts
        How many columns a line may have; all lines have as many as the first.
    separator
        What stands between columns; None for spaces.
    member
        Name of the file in the archive `path`; empty if the text is that of `path`.

    Raises
    ------
    TruthError
        A line has another number of columns, or cannot be parsed.
    """
    for line, content in numbered_lines(text):
        columns = content.split(separator)
        place: int | str = f"{member}:{line}" if member else line
        if len(columns) not in counts:
            wanted = " or ".join(map(str, counts))
            between = "commas" if separator else "spaces"
            what = f"{form} has {wanted} columns between {between}; this line has {len(columns)}"
            raise line_error(path, place, what)
        counts = (len(columns),)
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


def first_mistake(error: ValidationError) -> str:
    """Say in one line what is wrong in a document, and where."""
    first = error.errors(include_url=False, include_input=False, include_context=False)[0]
    place = ".".join(str(part) for part in first["loc"])
    return f"{place}: {first['msg']}" if place else first["msg"]
