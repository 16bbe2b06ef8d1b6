"""Which frames of a video are searched."""

import math
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
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
        Minimum number of searches a second; None for every frame.
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
        before, since = None, 0.0  # time of the frame before; seconds since the latest search
        for position, frame in enumerate(frames):
            if before is not None:
                steps.append(float(frame.time - before))
                if not 0 < steps[-1] < math.inf:
                    raise ValueError(
                        f"frame {frame.index} at {float(frame.time):g} s is not after the last one"
                    )
                since += steps[-1]
            before, is_searched = frame.time, self._is_due(position, since, steps)
            since = 0.0 if is_searched else since
            yield frame, is_searched

    def _is_due(self, position: int, since: float, steps: Sequence[float]) -> bool:
        if self.stride is not None:
            return position % self.stride == 0
        if self.searches is None or not position:
            return True
        ordered, quarter = sorted(steps), len(steps) // 4
        usual = fmean(ordered[quarter : len(steps) - quarter])  # a few odd steps do not change it
        longest = 1 / self.searches
        apart = max(1, int(longest / usual + _SLACK))  # frames
        return since >= min((apart - 0.5) * usual, longest)


EVERY_FRAME = SearchRate()
