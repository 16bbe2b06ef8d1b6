"""The class of a track: a vote of all searches that found the vehicle.

Only trackers vote. Each row of a track has its class so far; counts, records and pages, made at the
end of a video, use the class of the last row.
"""

from collections import defaultdict
from collections.abc import Mapping

from vdet.boxes import Float64Array, cut_sides
from vdet.config.classes import UNKNOWN

_USUAL, _USUAL_NEEDS = "car", 0.6
"""The class that detectors take for small or unclear vehicles of every kind, and the fraction of
all votes that it needs. On images that it has not seen, the shipped network is sure of cars to
0.93, but takes trucks and buses for cars to a third or a half.
"""

_UNUSUAL_NEED = 0.3
"""Fraction of all votes that another class needs; without one, the class is `UNKNOWN`."""

_CLOSE = 0.05
"""Fraction of the frame's area above which a larger box does not help to tell classes apart."""

_CUT_OFF = 0.1
"""Weight of a search that shows only a part of the vehicle: a cut-off truck looks like a car."""


class ClassVotes:
    """The votes of the searches that found a vehicle, by class."""

    def __init__(self) -> None:
        self._sums: defaultdict[str, float] = defaultdict(float)

    @property
    def winner(self) -> str | None:
        """The class with the most votes, or `UNKNOWN`; None if no detection had a class."""
        if not self._sums:
            return None
        total, unusual = sum(self._sums.values()), dict(self._sums)
        if unusual.pop(_USUAL, 0.0) >= _USUAL_NEEDS * total or not unusual:
            return _USUAL
        name = max(unusual, key=unusual.__getitem__)
        return name if unusual[name] >= _UNUSUAL_NEED * total else UNKNOWN

    def add(self, classes: Mapping[str, float], weight: float) -> None:
        """Add the votes of a search: the probability of each class, times the weight."""
        for name, probability in classes.items():
            self._sums[name] += weight * probability

    def join(self, votes: "ClassVotes") -> None:
        """Add the votes of another track of the same vehicle."""
        self.add(votes._sums, 1.0)


def vote_weight(box: Float64Array, score: float, size: tuple[int, int]) -> float:
    """Return the weight of a detection for the class: by its area and score, and if it is whole.

    Parameters
    ----------
    box
        x1, y1, x2, y2 in pixels, inside the frame.
    score
        0 to 1.
    size
        Width and height of the frame, pixels.
    """
    x1, y1, x2, y2 = map(float, box / (*size, *size))
    area = min((x2 - x1) * (y2 - y1), _CLOSE)
    return score * area * (_CUT_OFF if any(cut_sides((x1, y1, x2, y2), (1, 1))) else 1)
