"""How many vehicles are shown at once, over time."""

from collections.abc import Sequence

from vdet.track.track import FrameTracks


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
            first = int((begin - start) / step) if step else 0
            last = int((end - start) / step) if step else 0
            for index in range(min(first, number - 1), min(last, number - 1) + 1):
                levels[index] = max(levels[index], count)
        return levels
