"""Numbered pictures as one video: a pattern like those of `printf`, or a folder.

The pattern is `frames/img_%04d.png`, the folder `frames/`. The names of the pictures may also be
times of the clock, as in `20260501_070050.jpg`.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

from vdet.config.camera import ClockSettings
from vdet.errors import VideoError
from vdet.files import record_input
from vdet.media.images import is_picture_name

_PATTERN = re.compile(r"((?:[^%]|%%)*)%(?:0([1-9]\d*))?d((?:[^%]|%%)*)", re.ASCII)
_LAST_NUMBER = re.compile(r".*?(\d+)\D*\.\w+", re.ASCII | re.DOTALL)
ASSUMED_RATE = 25.0
"""Pictures per second, where neither the settings nor the names say."""


@dataclass(frozen=True, slots=True)
class PictureSequence:
    """Pictures that are a video.

    Attributes
    ----------
    files
        The pictures, in order.
    ticks, tick
        When each picture was taken after the first one, if its name says so; the unit in seconds.
    """

    files: tuple[Path, ...]
    ticks: tuple[int, ...] = ()
    tick: int = 1

    def timing(self, frame_rate: float | None) -> tuple[Fraction, Sequence[int]]:
        """Return the rate of the pictures, per second, and when each is shown, in such periods."""
        if self.ticks and frame_rate is None:
            return Fraction(1, self.tick), self.ticks
        return Fraction(str(frame_rate or ASSUMED_RATE)), range(len(self.files))


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
    pattern = None if path.exists() else _PATTERN.fullmatch(path.name)
    if not (pattern or path.is_dir()):
        return None
    folder, form = (path.parent, _form(*pattern.groups())) if pattern else (path, _LAST_NUMBER)
    try:
        matches = [(file, form.fullmatch(file.name)) for file in folder.iterdir()]
    except OSError as error:
        raise VideoError(f"{path}: {folder} cannot be read: {error.strerror}") from error
    found = sorted(
        (int(match[1]), file)
        for file, match in matches
        if match and (pattern or is_picture_name(file))
    )
    numbers, files = [number for number, _ in found], tuple(file for _, file in found)
    if not files:
        raise VideoError(f"{path}: no numbered pictures found; use a video, or -d DIR for a folder")
    record_input(*files)
    if by_the_clock := _by_the_clock(files):
        return by_the_clock
    steps = [following - number for number, following in pairwise(numbers)]
    kinds = {re.sub(r"\d", "", file.name, flags=re.ASCII) for file in files}
    if len(kinds) > 1 or 0 in steps:
        raise VideoError(f"{path}: has several kinds of names; use a pattern, as in img_%04d.png")
    step = min(steps, default=1)
    for number, gap in zip(numbers, steps, strict=False):
        if gap != step:
            raise VideoError(f"{path}: picture {number + step} is missing; put a copy of {number}")
    return PictureSequence(files)


def _by_the_clock(files: tuple[Path, ...]) -> PictureSequence | None:
    """Return the pictures if all their names are times, each another one."""
    times = {time: file for file in files if (time := ClockSettings().time_in(file.name))}
    if len(times) < len(files) or len({time.tzinfo for time in times}) > 1:
        return None
    ordered = sorted(times)
    seconds = [round((time - ordered[0]).total_seconds()) for time in ordered]
    tick = math.gcd(*seconds) or 1
    ticks = tuple(second // tick for second in seconds)
    return PictureSequence(tuple(times[time] for time in ordered), ticks, tick)


def _form(before: str, digits: str | None, after: str) -> re.Pattern[str]:
    """Return what matches the names that a pattern makes."""
    before, after = (re.escape(part.replace("%%", "%")) for part in (before, after))
    number = r"0|[1-9]\d*" if digits is None else rf"\d{{{digits}}}|[1-9]\d{{{digits},}}"
    return re.compile(f"{before}({number}){after}", re.ASCII | re.DOTALL)
