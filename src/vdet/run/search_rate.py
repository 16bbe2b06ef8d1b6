"""Which frames of a video are searched."""

import math
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from statistics import fmean

from vdet.media import Frame

_STEPS = 25
"""Number of the latest steps from frame to frame that give the usual step."""

_SLACK = 0.1
"""How far apart searches may be beyond 1 / `searches`, in frames.

With 12 searches a second, every second frame is searched at 23.976 frames/s, as at 24.
"""


@dataclass(frozen=True, slots=True)
class SearchRate:
    """How often the frames of a video are searched; the first one always is.

    Frames are chosen by their times, because the frame rate that a file declares may be wrong.

    Attributes
    ----------
    searches
        Least number of searches a second; None for every frame.
    stride
        Search every `stride`-th frame, whatever `searches` is; None to go by `searches`.
    """

    searches: float | None = None
    stride: int | None = None

    def choose(self, frames: Iterable[Frame]) -> Iterator[tuple[Frame, bool]]:
        """Yield each frame, and whether it is searched.

        Raises
        ------
        ValueError
            A time is not a finite number, or is not later than that of the frame before.
        """
        steps: deque[float] = deque(maxlen=_STEPS)
        before, since = None, 0.0  # time of the frame before, seconds since the latest search
        for position, frame in enumerate(frames):
            step = math.inf if before is None else float(frame.time - before)
            if not (step > 0 and math.isfinite(frame.time)):
                raise ValueError(
                    f"frame {frame.index} is at {float(frame.time):g} s; "
                    "give each frame a finite time, later than that of the frame before"
                )
            if before is not None:
                steps.append(step)
            since, before = since + step, frame.time
            is_searched = self._is_due(position, since, steps)
            if is_searched:
                since = 0.0
            yield frame, is_searched

    def _is_due(self, position: int, since: float, steps: Iterable[float]) -> bool:
        if self.stride is not None:
            return position % self.stride == 0
        if self.searches is None or not position:
            return True
        longest, usual = 1 / self.searches, _usual(steps)
        apart = max(1, int(longest / usual + _SLACK))  # frames
        return since >= min((apart - 0.5) * usual, longest)


def _usual(steps: Iterable[float]) -> float:
    """Return the mean of the middle half, which a few odd steps do not change."""
    ordered = sorted(steps)
    quarter = len(ordered) // 4
    return fmean(ordered[quarter : len(ordered) - quarter])


EVERY_FRAME = SearchRate()
