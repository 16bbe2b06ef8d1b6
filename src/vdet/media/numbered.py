"""Numbered pictures as one video: a pattern like those of `printf`, or a folder.

The pattern is `frames/img_%04d.png`, the folder `frames/`.
"""

import re
from collections import defaultdict
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from vdet.errors import VideoError
from vdet.files import printable
from vdet.media.images import is_picture_name

_PATTERN = re.compile(r"((?:[^%]|%%)*)%(?:0([1-9]\d*))?d((?:[^%]|%%)*)", re.ASCII)
_NUMBERED = re.compile(r"(.*?)(\d+)(\D*\.\w+)", re.ASCII | re.DOTALL)  # by its last number
ASSUMED_RATE = 25.0
"""Pictures per second, where the settings do not say."""

_MAX_WIDTH = 19  # digits; FFmpeg has no room for more


@dataclass(frozen=True, slots=True)
class PictureSequence:
    """Pictures whose numbers rise by `step` without a gap, from `first` on.

    `pattern` is their absolute name, with ``%d`` or ``%04d`` for the number. Every other per cent
    sign in it is doubled.
    """

    pattern: str
    first: int
    step: int = 1

    @property
    def first_picture(self) -> Path:
        """The file of the first picture."""
        return Path(self.pattern % self.first)

    @property
    def glob(self) -> str:
        """The pattern of `glob` that the pictures have, whose numbers all have as many digits."""
        match = _PATTERN.fullmatch(self.pattern)
        assert match is not None
        before, digits, after = match.groups()
        lead = "[0-9]" if digits else "[1-9]"
        rest = "[0-9]" * (len(str(self.first).zfill(int(digits or 0))) - 1)
        return f"{_escaped(before)}{lead}{rest}{_escaped(after)}"


def find_sequence(path: Path) -> PictureSequence | None:
    """Return the pictures that the pattern or the folder `path` names; None where it is neither.

    They may begin at any number, and rise by any step. In the name of a folder, a per cent sign
    means itself.

    Raises
    ------
    VideoError
        The folder cannot be read, there is no such picture in it, or one is missing. The pictures
        of a folder are not one sequence.
    """
    if path.is_dir():
        return _sequence(path, _only_pattern(path), named=path)
    if path.exists() or not _PATTERN.fullmatch(path.name):
        return None
    return _sequence(path.parent, path.name, named=path)


def _sequence(folder: Path, name: str, *, named: Path) -> PictureSequence:
    """Return the pictures of a pattern in a folder; errors name the path `named`."""
    pattern = _PATTERN.fullmatch(name)
    assert pattern is not None
    if int(pattern[2] or 0) > _MAX_WIDTH:
        raise VideoError(f"{named}: numbers have at most {_MAX_WIDTH} digits; rename the pictures")
    names = _names(folder, named)
    numbers = _numbers(names, pattern)
    if not numbers:
        others = " or ".join(f"{folder / printable(each)}" for each in _patterns(names)[:2])
        advice = f"give {others}" if others else f"{folder} has no numbered pictures at all"
        raise VideoError(f"{named}: there is no such file, and no picture of such a name; {advice}")
    step = min((following - number for number, following in pairwise(numbers)), default=1)
    for number, following in pairwise(numbers):
        if following != number + step:
            raise VideoError(
                f"{named}: picture {number + step} is missing, between {number} and {following}; "
                "put a copy of its neighbour there, or number the pictures anew"
            )
    if step > 1 and len(str(numbers[-1])) > max(int(pattern[2] or 0), len(str(numbers[0]))):
        raise VideoError(
            f"{named}: the numbers rise by {step} and have {len(str(numbers[0]))} or more digits; "
            "fill them all with zeros to the same length"
        )
    whole = _doubled(str(folder.absolute()))
    return PictureSequence(f"{whole}/{name}", numbers[0], step)


def _numbers(names: list[str], pattern: re.Match[str]) -> list[int]:
    before, digits, after = pattern.groups()
    before, after = (re.escape(part.replace("%%", "%")) for part in (before, after))
    number = r"0|[1-9]\d*" if digits is None else rf"\d{{{digits}}}|[1-9]\d{{{digits},}}"
    form = re.compile(f"{before}({number}){after}", re.ASCII | re.DOTALL)
    found = (form.fullmatch(name) for name in names)
    return sorted(int(match[1]) for match in found if match)


def _only_pattern(folder: Path) -> str:
    """Return the pattern of the pictures in a folder; they must have one. Raises `VideoError`."""
    patterns = _patterns(_names(folder, folder))
    if not patterns:
        raise VideoError(
            f"{folder}: is a folder without numbered pictures; give a video file, or -d DIR for "
            "the videos in it"
        )
    if len(patterns) > 1:
        some = " or ".join(f"{folder / printable(pattern)}" for pattern in patterns[:2])
        raise VideoError(f"{folder}: holds pictures with names of several kinds; give {some}")
    return patterns[0]


def _patterns(names: list[str]) -> list[str]:
    """Return the patterns of all numbered pictures, that of the most pictures first."""
    groups: defaultdict[tuple[str, str], list[str]] = defaultdict(list)
    for name in names:
        match = _NUMBERED.fullmatch(name)
        if match and is_picture_name(Path(name)):
            before, number, after = match.groups()
            groups[before, after].append(number)
    ordered = sorted(groups.items(), key=lambda item: (-len(item[1]), item[0]))
    return [
        f"{_doubled(ends[0])}{_conversion(digits)}{_doubled(ends[1])}" for ends, digits in ordered
    ]


def _conversion(numbers: list[str]) -> str:
    """Return ``%d``, or ``%04d`` where numbers are filled with zeros to four digits."""
    width = min(map(len, numbers))
    return f"%0{width}d" if any(each[0] == "0" and len(each) > 1 for each in numbers) else "%d"


def _escaped(text: str) -> str:
    """Return a part of a pattern as a part of a pattern of `glob`, in which it means itself."""
    return re.sub(r"([][*?{}~\\])", r"\\\1", text.replace("%%", "%"))


def _doubled(text: str) -> str:
    return text.replace("%", "%%")


def _names(folder: Path, named: Path) -> list[str]:
    try:
        return [entry.name for entry in folder.iterdir()]
    except OSError as error:
        what = "its folder" if folder != named else "it"
        raise VideoError(f"{named}: {what} cannot be read: {error.strerror}") from error
