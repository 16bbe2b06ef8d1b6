"""Numbered pictures as one video: a pattern like those of `printf`, or a folder.

The pattern is `frames/img_%04d.png`, the folder `frames/`.
"""

import re
from collections import defaultdict
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from vdet.errors import VideoError, printable
from vdet.files import record_input
from vdet.media.images import is_picture_name

_PATTERN = re.compile(r"((?:[^%]|%%)*)%(?:0([1-9]\d*))?d((?:[^%]|%%)*)", re.ASCII)
_NUMBERED = re.compile(r"(.*?)(\d+)(\D*\.\w+)", re.ASCII | re.DOTALL)  # by its last number
ASSUMED_RATE = 25.0
"""Pictures per second, where the settings do not say."""


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
    def glob(self) -> str:
        """The pattern of `glob` that the pictures have, whose numbers all have as many digits."""
        match = _PATTERN.fullmatch(self.pattern)
        assert match is not None
        before, digits, after = match.groups()
        number = "[0-9]" * len(str(self.first).zfill(int(digits or 0)))
        return f"{_escaped(before)}{number}{_escaped(after)}"


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
        folder, names = path, _names(path, path)
        name = _only_pattern(path, names)
    elif path.exists() or not _PATTERN.fullmatch(path.name):
        return None
    else:
        folder, name, names = path.parent, path.name, _names(path.parent, path)
    numbers = _numbers(names, name)
    if not numbers:
        raise VideoError(
            f"{path}: there is no such file, and no picture of such a name; "
            f"{_known(folder, names) or f'{folder} has no numbered pictures at all'}"
        )
    step = min((following - number for number, following in pairwise(numbers)), default=1)
    for number, following in pairwise(numbers):
        if following != number + step:
            raise VideoError(f"{path}: picture {number + step} is missing; put a copy of {number}")
    if step > 1 and len({len(name % number) for number in (numbers[0], numbers[-1])}) > 1:
        raise VideoError(f"{path}: numbers that rise by {step} need one length; fill with zeros")
    record_input(*(folder / (name % number) for number in numbers))
    return PictureSequence(f"{_doubled(str(folder.absolute()))}/{name}", numbers[0], step)


def _numbers(names: list[str], pattern: str) -> list[int]:
    match = _PATTERN.fullmatch(pattern)
    assert match is not None
    before, digits, after = match.groups()
    before, after = (re.escape(part.replace("%%", "%")) for part in (before, after))
    number = r"0|[1-9]\d*" if digits is None else rf"\d{{{digits}}}|[1-9]\d{{{digits},}}"
    form = re.compile(f"{before}({number}){after}", re.ASCII | re.DOTALL)
    return sorted(int(match[1]) for match in map(form.fullmatch, names) if match)


def _only_pattern(folder: Path, names: list[str]) -> str:
    """Return the one pattern of the pictures in a folder. Raises `VideoError`."""
    patterns = _patterns(names)
    if not patterns:
        raise VideoError(
            f"{folder}: has no numbered pictures; give a video, or -d DIR for those in it"
        )
    if len(patterns) > 1:
        raise VideoError(f"{folder}: has several kinds of names; {_known(folder, names)}")
    return patterns[0]


def _known(folder: Path, names: list[str]) -> str:
    """Return advice that names patterns of existing pictures."""
    some = [f"{folder / printable(pattern)}" for pattern in _patterns(names)[:2]]
    return f"give {' or '.join(some)}" if some else ""


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
        f"{_doubled(before)}{_conversion(digits)}{_doubled(after)}"
        for (before, after), digits in ordered
    ]


def _conversion(numbers: list[str]) -> str:
    """Return ``%d``, or ``%04d`` where numbers are filled with zeros to four digits."""
    width = min(map(len, numbers))
    return f"%0{width}d" if any(each[0] == "0" and len(each) > 1 for each in numbers) else "%d"


def _escaped(text: str) -> str:
    """Escape a part of a pattern for `glob`."""
    return re.sub(r"([][*?{}~\\])", r"\\\1", text.replace("%%", "%"))


def _doubled(text: str) -> str:
    return text.replace("%", "%%")


def _names(folder: Path, named: Path) -> list[str]:
    try:
        return [entry.name for entry in folder.iterdir()]
    except OSError as error:
        raise VideoError(f"{named}: {folder} cannot be read: {error.strerror}") from error
