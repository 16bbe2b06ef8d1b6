"""How windows lie to a vehicle: whether they fit it, show it ill placed, or only a part of it.

Lengths are in sides of the window, from its centre. A vehicle that the frame's left or right cuts
off is told by its one visible side, for where the other would be, nobody knows.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vdet.geometry import Float64Array, coverage

Flags = npt.NDArray[np.bool_]

_EDGE = 0.002  # of the frame's width: a box that comes so close to its side is cut off by it


@dataclass(frozen=True, slots=True, eq=False)
class Placing:
    """Windows, seen from one vehicle.

    `sides` is float64 `(n, 4)`: left, top, right, bottom of the vehicle, NaN where the frame cuts
    it off. `distances` `(n,)` is how far its middle is from the window's, the larger of across and
    down. The flags `(n,)`: a window that `fits` is a picture of the vehicle, one that `shows` it
    has it too small, too large or beside the middle; one on a `part` lies in the vehicle, which is
    far too large for it, and is no picture of a vehicle though it may show one. Those that fit or
    show it, and others, are `near` it.
    """

    sides: Float64Array
    distances: Float64Array
    fits: Flags
    shows: Flags
    part: Flags
    near: Flags


def place(windows: Float64Array, vehicle: Float64Array, frame_width: int) -> Placing:
    """Say how windows lie to a vehicle.

    Parameters
    ----------
    windows
        `(n, 4)`: x, y, width, height of squares, frame pixels.
    vehicle
        `(4,)`: the same of the vehicle's box, its part inside the frame.
    frame_width
        Pixels.
    """
    size = windows[:, 2]
    middle = windows[:, :2] + windows[:, 2:] / 2
    corners = np.concatenate([vehicle[:2], vehicle[:2] + vehicle[2:]])
    sides = (corners - np.tile(middle, 2)) / size[:, np.newaxis]
    look = _Look(
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
        fits, shows = _of_cut(look, sides[:, 2] if cut[0] else -sides[:, 0])
    else:
        fits, shows = _of_whole(look)
    sides[:, [0, 2]] = np.where(cut, np.nan, sides[:, [0, 2]])
    near = look.near | fits | shows
    distances = np.maximum(look.across, look.down)
    return Placing(sides, distances, fits, shows & ~fits, look.part & ~fits, near)


def cut_sides(vehicle: Float64Array, frame_width: int) -> Flags:
    """Tell whether the frame's left and right cut a vehicle's box `(4,)` off, bool `(2,)`."""
    edge = _EDGE * frame_width
    return np.array([vehicle[0] <= edge, vehicle[0] + vehicle[2] >= frame_width - edge])


@dataclass(frozen=True, slots=True, eq=False)
class _Look:
    """A vehicle in windows, each `(n,)`.

    How far its middle is off `across` and `down`, its `width` and `height`, and the share of the
    window that it covers.
    """

    across: Float64Array
    down: Float64Array
    width: Float64Array
    height: Float64Array
    covered: Float64Array

    @property
    def part(self) -> Flags:
        """Whether the window lies in the vehicle, which is far too large for it."""
        return (self.covered > 0.5) & ((self.width > 2.5) | (self.height > 1.3))

    @property
    def near(self) -> Flags:
        """Whether the window has to do with the vehicle at all."""
        close = (self.across < 0.75) & (self.down < 0.4) & (self.covered > 0.12)
        return close & (self.width > 0.4) & (self.width < 3)


def _of_whole(look: _Look) -> tuple[Flags, Flags]:
    width, across, down = look.width, look.across, look.down
    fits = (width > 0.72) & (width < 1.3) & (across < 0.16) & (down < 0.16)
    shows = (width > 0.4) & (width < 2.5) & (across < 0.45) & (down < 0.25)
    return fits, shows


def _of_cut(look: _Look, visible: Float64Array) -> tuple[Flags, Flags]:
    """Tell by the height and by `visible`, how far from the middle the visible side is."""
    height, down, covered = look.height, look.down, look.covered
    fits = (height > 0.35) & (height < 0.85) & (down < 0.16) & (covered > 0.3)
    shows = (height > 0.3) & (height < 1) & (down < 0.25) & (covered > 0.12)
    return fits & (visible > 0.3) & (visible < 0.62), shows & (visible > 0.2) & (visible < 0.8)
