"""Frame times that increase, from a file's timestamps, which need not."""

from fractions import Fraction


class Clock:
    """Gives each frame its time; a guess where the file has none, or one that is not later.

    The guess is one frame period (`period`, seconds) after the frame before.
    """

    def __init__(self, time_base: Fraction, period: Fraction) -> None:
        self._time_base = time_base
        self._period = period
        self._last: Fraction | None = None

    def time(self, pts: int | None) -> Fraction:
        """Return the time, in seconds, of the next frame, whose timestamp is `pts` time bases."""
        stated = None if pts is None else pts * self._time_base
        if self._last is None:
            self._last = stated or Fraction(0)
        elif stated is None or stated <= self._last:
            self._last += self._period
        else:
            self._last = stated
        return self._last
