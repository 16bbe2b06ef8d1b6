"""One vehicle at one line or zone: on which side it is, and when it changes the side."""

import math
from dataclasses import dataclass, replace

from vdet.polygons import Point
from vdet.traffic.layout import Border

CLOCK = 1e-4
"""Seconds by which a duration may be shorter than is asked for: times are rounded."""


@dataclass(frozen=True, slots=True)
class Sighting:
    """A vehicle as it is seen in a frame: where its foot is, and the height of its box, pixels."""

    time: float
    frame: int
    point: Point
    height: float
    score: float


@dataclass(frozen=True, slots=True)
class Change:
    """A change to the side of the sign `side`; `where` is the point at which the path crosses.

    `path` is whether it meets the border; if not, it passes beyond the ends of a line.
    """

    side: int
    time: float
    frame: int
    where: Point
    score: float
    meets: bool
    stitched: bool = False


@dataclass(slots=True)
class BorderState:
    """What is remembered of a vehicle at a border.

    Attributes
    ----------
    side
        The settled side, 1 or -1; 0 before it is known.
    """

    side: int = 0
    _last: Sighting | None = None
    _sign: int = 0  # of the last place that was not exactly on the border
    _beyond: int = 0  # the side on which it is beyond the band
    _since: float = 0.0  # when it came there
    _far: int = 0  # the side on which it was seen one height away last, until that is confirmed
    _change: Change | None = None  # the last time at which it was over the border
    _crossed: Point | None = None  # where it last crossed and was counted
    _stitched: bool = False

    def taken_over(self) -> "BorderState":
        """Return a copy for the track that goes on with the vehicle."""
        return replace(self, _stitched=True)

    def see(self, sighting: Sighting, border: Border, band: float, settled: float) -> Change | None:
        """Take in the next sighting; return the change of the settled side, if there is one.

        The first side that is settled is no change.
        """
        distance = border.distance(sighting.point)
        sign = (distance > 0) - (distance < 0)
        self._follow(sighting, sign, border)
        is_far = abs(distance) >= sighting.height
        was_far = self._far == sign
        self._far = sign if is_far and abs(distance) > band else 0
        if abs(distance) <= band:
            self._beyond = 0
            return self._settle(sign, sighting, is_far=True) if was_far and sign else None
        if self._beyond != sign:
            self._beyond, self._since = sign, sighting.time
        if was_far or sighting.time - self._since >= settled - CLOCK:
            return self._settle(sign, sighting, is_far=is_far or was_far)
        return None

    def end(self) -> Change | None:
        """Return the change that the last sighting shows, if the vehicle is not seen again."""
        if self._far and self._last is not None:
            return self._settle(self._far, self._last, is_far=True)
        return None

    def _follow(self, sighting: Sighting, sign: int, border: Border) -> None:
        """Note where the path goes over the border."""
        before, self._last = self._last, sighting
        if sign == 0:
            return
        if before is not None and self._sign == -sign:
            self._change = _change(before, sighting, sign, border)
        self._sign = sign

    def _settle(self, side: int, sighting: Sighting, *, is_far: bool) -> Change | None:
        if self.side in (side, 0):
            self.side, self._stitched = side, False
            return None
        change = self._change
        if change is None or change.side != side:  # it was on the border when it was first seen
            return None
        if (
            self._crossed is not None
            and not is_far
            and math.dist(change.where, self._crossed) < sighting.height
        ):
            return None
        self.side = side
        self._crossed = change.where if change.meets else None
        stitched, self._stitched = self._stitched, False
        return replace(change, stitched=stitched)


def _change(before: Sighting, after: Sighting, side: int, border: Border) -> Change:
    share = border.meeting((before.point, after.point))
    along = 1.0 if share is None else share
    (ax, ay), (bx, by) = before.point, after.point
    time = before.time + along * (after.time - before.time)
    where = ax + along * (bx - ax), ay + along * (by - ay)
    return Change(side, time, after.frame, where, after.score, meets=share is not None)
