"""Text files and the numbers in them, read strictly."""

import io
import re
from collections.abc import Iterator
from pathlib import Path

from vdet.errors import TruthError
from vdet.files import read_whole

LIMIT = 10_000_000
"""No frame, id or pixel is beyond it: what is larger is damage, and would overflow further on."""

MAX_BYTES = 64_000_000
"""Of a file of boxes."""

_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)


def read_text(path: Path) -> str:
    """Return the text of a UTF-8 file.

    Raises
    ------
    TruthError
        The file cannot be read, is larger than `MAX_BYTES` or is not text.
    """
    data = read_whole(path, most=MAX_BYTES, what="file of boxes", error=TruthError)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise TruthError(f"{path}: is not text (UTF-8); give a file of boxes") from error
    if "\0" in text:
        raise TruthError(f"{path}: is not text (UTF-8); give a file of boxes")
    return text


def numbered_lines(text: str) -> Iterator[tuple[int, str]]:
    """Give every line that is not blank, stripped, with its number from 1."""
    for number, line in enumerate(io.StringIO(text, newline=None), start=1):
        if stripped := line.strip():
            yield number, stripped


def number(text: str) -> float:
    """Return the decimal number that `text` spells, at most `LIMIT` either way.

    Raises
    ------
    ValueError
        It is another thing: words, NaN, infinity, something larger.
    """
    stripped = text.strip()
    if not _NUMBER.fullmatch(stripped):
        raise ValueError(f"{stripped!r:.40} is not a number")
    value = float(stripped)
    if abs(value) > LIMIT:
        raise ValueError(f"{stripped!r:.40} is beyond {LIMIT}")
    return value


def whole(text: str) -> int:
    """Return the whole number that `text` spells (`3` and `3.0` are both 3).

    Raises
    ------
    ValueError
        It is not one, or it is beyond `LIMIT`.
    """
    value = number(text)
    if not value.is_integer():
        raise ValueError(f"{text.strip()!r:.40} is not a whole number")
    return int(value)
