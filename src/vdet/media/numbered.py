"""Numbered pictures as one video: `frames/img_%04d.png`, a pattern like those of `printf`."""

import re
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from vdet.errors import VideoError

_PATTERN = re.compile(r"((?:[^%]|%%)*)%(?:0([1-9]))?d((?:[^%]|%%)*)")


@dataclass(frozen=True, slots=True)
class PictureSequence:
    """Pictures without a gap, from number `first` on.

    `pattern` is their absolute name, with ``%d`` or ``%04d`` for the number. Every other per cent
    sign in it is doubled.
    """

    pattern: str
    first: int


def find_sequence(path: Path) -> PictureSequence | None:
    """Return the pictures that the pattern `path` names; None where it is no pattern, or a file.

    They may begin at any number. In the name of a folder, a per cent sign means itself.

    Raises
    ------
    VideoError
        The folder cannot be read, there is no such picture in it, or one is missing.
    """
    pattern = _PATTERN.fullmatch(path.name)
    if pattern is None or path.exists():
        return None
    numbers = _numbers(path, pattern)
    if not numbers:
        raise VideoError(f"{path}: there is no such file, and no picture of such a name")
    for number, following in pairwise(numbers):
        if following != number + 1:
            raise VideoError(
                f"{path}: picture {number + 1} is missing, between {number} and {following}; "
                "add it, or number the pictures without a gap"
            )
    folder = str(path.parent.absolute()).replace("%", "%%")
    return PictureSequence(f"{folder}/{path.name}", numbers[0])


def _numbers(path: Path, pattern: re.Match[str]) -> list[int]:
    before, digits, after = pattern.groups()
    before, after = (re.escape(part.replace("%%", "%")) for part in (before, after))
    number = r"0|[1-9]\d*" if digits is None else rf"\d{{{digits}}}|[1-9]\d{{{digits},}}"
    name = re.compile(f"{before}({number}){after}", re.ASCII | re.DOTALL)
    try:
        found = [name.fullmatch(entry.name) for entry in path.parent.iterdir()]
    except OSError as error:
        raise VideoError(f"{path}: its folder cannot be read: {error.strerror}") from error
    return sorted(int(match[1]) for match in found if match)
