"""How windows lie to a vehicle: whether they fit it, show it badly, or only show a part of it.

Lengths are in sides of the window, from its centre. A vehicle that the left or right side of the
frame cuts off is located by its one visible side; where the other side would be is unknown.
"""

from dataclasses import dataclass

import numpy as np

from vdet.geometry import BoolArray, Float64Array, coverage

_EDGE = 0.002  # of the frame's width: a box this close to a side of the frame is cut off by it


@dataclass(frozen=True, slots=True, eq=False)
class Placing:
    """How `n` windows lie to one vehicle.

    Attributes
    ----------
    sides
        float64 `(n, 4)`: left, top, right, bottom of the vehicle, NaN where the frame cuts it off.
    distances
        float64 `(n,)`: distance of the two centres, the larger of across and down.
    fits
        bool `(n,)`: the window is a good picture of the vehicle.
    shows
        bool `(n,)`: the vehicle is too small, too large or off the centre.
    part
        bool `(n,)`: the window lies in the vehicle, which is far too large for it. It counts as no
        picture of a vehicle, even if it `shows` one.
    near
        bool `(n,)`: the window fits or shows the vehicle, or overlaps it otherwise.
    """

    sides: Float64Array
    distances: Float64Array
    fits: BoolArray
    shows: BoolArray
    part: BoolArray
    near: BoolArray


def place(windows: Float64Array, vehicle: Float64Array, frame_width: int) -> Placing:
    """Return how windows lie to a vehicle.

    Parameters
    ----------
    windows
        `(n, 4)`: x, y, width, height of squares, frame pixels.
    vehicle
        `(4,)`: the same of the part of the vehicle's box inside the frame.
    frame_width
        Width of the frame, pixels.
    """
    size = windows[:, 2]
    middle = windows[:, :2] + windows[:, 2:] / 2
    corners = np.concatenate([vehicle[:2], vehicle[:2] + vehicle[2:]])
    sides = (corners - np.tile(middle, 2)) / size[:, np.newaxis]
    measures = _Measures(
        abs(sides[:, 0] + sides[:, 2]) / 2,
        abs(sides[:, 1] + sides[:, 3]) / 2,
        vehicle[2] / size,
        vehicle[3] / size,
        coverage(windows, vehicle[np.newaxis])[:, 0],
    )
    cut = cut_sides(vehicle, frame_width)
    if cut.all():
        fits = shows = np.zeros(len(windows), np.bool_)
    elif cut.any():
        fits, shows = _of_cut(measures, sides[:, 2] if cut[0] else -sides[:, 0])
    else:
        fits, shows = _of_whole(measures)
    sides[:, [0, 2]] = np.where(cut, np.nan, sides[:, [0, 2]])
    near = measures.near | fits | shows
    distances = np.maximum(measures.across, measures.down)
    return Placing(sides, distances, fits, shows & ~fits, measures.part & ~fits, near)


def cut_sides(vehicle: Float64Array, frame_width: int) -> BoolArray:
    """Return whether the left and right side of the frame cut a box `(4,)` off, bool `(2,)`."""
    edge = _EDGE * frame_width
    return np.array([vehicle[0] <= edge, vehicle[0] + vehicle[2] >= frame_width - edge])


@dataclass(frozen=True, slots=True, eq=False)
class _Measures:
    """Measures of a vehicle in `n` windows, each `(n,)`.

    The distance of its centre `across` and `down`, its `width` and `height`, and the share of the
    window that it covers.
    """

    across: Float64Array
    down: Float64Array
    width: Float64Array
    height: Float64Array
    covered: Float64Array

    @property
    def part(self) -> BoolArray:
        """Whether the vehicle is far too large for the window, which lies in it."""
        return (self.covered > 0.5) & ((self.width > 2.5) | (self.height > 1.3))

    @property
    def near(self) -> BoolArray:
        """Whether the window overlaps the vehicle, and both have a similar place and size."""
        close = (self.across < 0.75) & (self.down < 0.4) & (self.covered > 0.12)
        return close & (self.width > 0.4) & (self.width < 3)


def _of_whole(measures: _Measures) -> tuple[BoolArray, BoolArray]:
    width, across, down = measures.width, measures.across, measures.down
    fits = (width > 0.72) & (width < 1.3) & (across < 0.16) & (down < 0.16)
    shows = (width > 0.4) & (width < 2.5) & (across < 0.45) & (down < 0.25)
    return fits, shows


def _of_cut(measures: _Measures, visible: Float64Array) -> tuple[BoolArray, BoolArray]:
    """Judge by the height and by `visible`, the distance of the visible side from the centre."""
    height, down, covered = measures.height, measures.down, measures.covered
    fits = (height > 0.35) & (height < 0.85) & (down < 0.16) & (covered > 0.3)
    shows = (height > 0.3) & (height < 1) & (down < 0.25) & (covered > 0.12)
    return fits & (visible > 0.3) & (visible < 0.62), shows & (visible > 0.2) & (visible < 0.8)
