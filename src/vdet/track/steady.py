"""Smooths the sides of boxes in time, for display.

Each side of a box has a g-h filter with fading memory. It follows a side that moves steadily
without lag, and begins with growing memory (Brookner, "Tracking and Kalman Filtering Made
Easy", 1998, chapter 1). A side stays close to its input, so that a vehicle that
brakes or comes near is not left behind.
"""

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace

import numpy as np

from vdet.boxes import Box, Float64Array
from vdet.track.track import Track

LIMIT = 0.025
"""Largest distance of a side from its input, as a share of the box's width or height."""

SETTLING = 0.05
"""Share of the limit's correction of a side that also corrects its speed."""

GAP = 0.5
"""Seconds after which the filter starts again for a vehicle that comes back."""

SHORTEST_STEP = 0.001
"""Least number of seconds between two frames."""


@dataclass(slots=True)
class _Sides:
    """The four sides of a box, pixels, with their speeds; `count` of boxes so far."""

    places: Float64Array
    speeds: Float64Array
    time: float
    count: int = 1


class SteadyBoxes:
    """Smooths the boxes of the vehicles of one video.

    Parameters
    ----------
    seconds
        Memory of the filter: a box of this long ago has a weight of 1/e.
    """

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._sides: dict[int, _Sides] = {}

    def update(self, tracks: Sequence[Track], time: float) -> list[Track]:
        """Return the tracks of the next frame, shown at `time` seconds, with smoothed boxes.

        The foot of a track moves with its box. Boxes may reach a little beyond the frame.
        """
        self._sides = {id_: each for id_, each in self._sides.items() if time - each.time <= GAP}
        return [_with_box(track, self._smoothed(track, time)) for track in tracks]

    def _smoothed(self, track: Track, time: float) -> Box:
        given = np.array(astuple(track.box), np.float64)
        sides = self._sides.get(track.id)
        if sides is None:
            self._sides[track.id] = _Sides(given, np.zeros(4), time)
            return track.box
        elapsed = max(time - sides.time, SHORTEST_STEP)
        kept = math.exp(-elapsed / self._seconds)
        sides.time, sides.count = time, sides.count + 1
        together = sides.count * (sides.count + 1)
        g = max(1 - kept**2, 2 * (2 * sides.count - 1) / together)
        h = max((1 - kept) ** 2, 6 / together)
        limits = LIMIT * np.array([track.box.width, track.box.height] * 2)
        error = given - sides.places - sides.speeds * elapsed
        places = given - (1 - g) * error
        sides.places = np.clip(places, given - limits, given + limits)
        sides.speeds = sides.speeds + (h * error + SETTLING * (sides.places - places)) / elapsed
        return Box(*sides.places.tolist())


def _with_box(track: Track, box: Box) -> Track:
    (x, y), (old_x, old_y), (new_x, new_y) = track.foot, track.box.foot, box.foot
    return replace(track, box=box, whole_foot=(x + (new_x - old_x), y + (new_y - old_y)))
