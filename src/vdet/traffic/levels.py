"""How many vehicles are shown at once, over time."""

import math
from collections.abc import Sequence

from vdet.track.track import FrameTracks

_ROUNDING = 1e-6  # of a step


class Levels:
    """How many vehicles are shown at once: the moments at which that changes."""

    def __init__(self) -> None:
        self._changes: list[tuple[float, int]] = []
        self._last = 0.0

    def add(self, frame: FrameTracks) -> None:
        """Add the next frame."""
        self._last = frame.time
        if not self._changes or self._changes[-1][1] != len(frame.tracks):
            self._changes.append((frame.time, len(frame.tracks)))

    @property
    def most(self) -> int:
        """The most vehicles at once."""
        return max((count for _, count in self._changes), default=0)

    def steps(self, number: int) -> Sequence[int]:
        """Cut the time from the first to the last frame into equal steps.

        Returns
        -------
        The most vehicles at once in each of the `number` steps.
        """
        levels = [0] * number
        if not self._changes:
            return levels
        start = self._changes[0][0]
        step = (self._last - start) / number
        ends = [time for time, _ in self._changes[1:]] + [self._last]
        for (begin, count), end in zip(self._changes, ends, strict=True):
            first = min(number - 1, int((begin - start) / step + _ROUNDING)) if step else 0
            last = math.ceil((end - start) / step - _ROUNDING) if step else 0
            for index in range(first, max(first + 1, last)):
                levels[index] = max(levels[index], count)
        return levels
