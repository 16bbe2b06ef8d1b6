"""Which windows of a labelled frame become patches.

Each window is compared with each vehicle. Lengths are in sides of the window, from its centre. A
vehicle that the left or right side of the frame cuts off is located by its visible side; the place
of its other side is unknown.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from vdet.boxes import BoolArray, Box, Float64Array, coverage, from_sizes
from vdet.detect.svm.windows import Windows
from vdet.learn.svm.dataset import Sides

PatchKind = Literal["vehicle", "box", "false alarm", "part"]
"""`vehicle`: the window fits a vehicle. `box`: it shows one off its centre or of another size.
`false alarm`: it is taken for a vehicle, but there is none. `part`: it is taken for a vehicle, but
shows only a part of one."""


@dataclass(frozen=True, slots=True)
class Most:
    """Maximum number of windows that are chosen in a frame.

    For each vehicle, at most `per_vehicle` windows that fit it, and as many others that show it. In
    the whole frame, at most `false_alarms` windows where no vehicle is, and `parts` that show only
    a part of one: with many parts, fewer vehicles are found as a whole. False alarms and parts have
    at least `probability`.
    """

    per_vehicle: int = 16
    false_alarms: int = 15
    parts: int = 10
    probability: float = 0.2


MOST = Most()

_MAX_COVERED = 0.3
"""Largest fraction of a false alarm that a vehicle or an ignore region may cover."""

_EDGE = 0.002  # of the frame's width: a box this close to a side of the frame is cut off by it


@dataclass(frozen=True, slots=True)
class ChosenWindow:
    """A window that becomes a patch, and the sides of the vehicle in it."""

    kind: PatchKind
    box: Box
    sides: Sides | None


def choose_windows(
    windows: Windows,
    labelled: Float64Array,
    ignored: BoolArray,
    frame_width: int,
    rng: np.random.Generator,
    *,
    most: Most,
) -> Iterator[ChosenWindow]:
    """Choose from the windows of a frame, of each kind at most as many as `most` says.

    Parameters
    ----------
    windows
        All windows of the frame, with the probabilities of the model that is to be improved.
    labelled, ignored
        float64 `(n, 4)`: x1, y1, x2, y2, pixels, of the true vehicles and the ignore regions of the
        frame; bool `(n,)`: which are ignore regions.
    frame_width
        Width of the frame, pixels.
    """
    _, first = np.unique(windows.boxes, axis=0, return_index=True)
    boxes, vehicles = from_sizes(windows.boxes[first]), labelled[~ignored]
    is_hit = windows.probabilities[first] >= most.probability
    comparisons = [compare_windows(boxes, vehicle, frame_width) for vehicle in vehicles]
    of_none = np.full(len(boxes), np.inf)
    nearest = np.argmin([of_none, *(item.distances for item in comparisons)], axis=0) - 1
    is_covered = coverage(boxes, np.concatenate([vehicles, labelled[ignored]])) > _MAX_COVERED
    is_alarm = is_hit & (nearest < 0) & ~is_covered.any(axis=1)
    is_part = np.zeros(len(boxes), np.bool_)

    def some(kind: PatchKind, flags: BoolArray, most: int, sides: Any = None) -> Iterator[Any]:
        for row in sorted(rng.permutation(np.flatnonzero(flags))[:most].tolist()):
            seen = None if sides is None else tuple(sides[row].tolist())
            yield ChosenWindow(kind, Box(*boxes[row].tolist()), seen)

    for number, comparison in enumerate(comparisons):
        own = nearest == number
        is_part |= is_hit & comparison.part & ~np.delete(is_covered, number, axis=1).any(axis=1)
        yield from some("vehicle", comparison.fits & own, most.per_vehicle, comparison.sides)
        yield from some("box", comparison.shows & own, most.per_vehicle, comparison.sides)
    yield from some("false alarm", is_alarm, most.false_alarms)
    yield from some("part", is_part, most.parts)


@dataclass(frozen=True, slots=True, eq=False)
class WindowComparison:
    """What `n` windows show of one vehicle.

    Attributes
    ----------
    sides
        float64 `(n, 4)`: left, top, right, bottom of the vehicle, NaN where the frame cuts it off.
    distances
        float64 `(n,)`: distance of the two centres, the larger of across and down; infinite where
        the window neither fits nor shows the vehicle, nor overlaps it otherwise.
    fits
        bool `(n,)`: the window is a good picture of the vehicle.
    shows
        bool `(n,)`: the vehicle is too small, too large or off the centre.
    part
        bool `(n,)`: the window lies in the vehicle, which is far too large for it. It counts as no
        picture of a vehicle, even if it `shows` one.
    """

    sides: Float64Array
    distances: Float64Array
    fits: BoolArray
    shows: BoolArray
    part: BoolArray


def compare_windows(
    windows: Float64Array, vehicle: Float64Array, frame_width: int
) -> WindowComparison:
    """Compare windows with a vehicle.

    Parameters
    ----------
    windows
        `(n, 4)`: x1, y1, x2, y2 of squares, frame pixels.
    vehicle
        `(4,)`: the same of the part of the vehicle's box inside the frame.
    frame_width
        Width of the frame, pixels.
    """
    size = windows[:, 2] - windows[:, 0]
    middle = (windows[:, :2] + windows[:, 2:]) / 2
    sides = (vehicle - np.tile(middle, 2)) / size[:, np.newaxis]
    across, down = abs(sides[:, :2] + sides[:, 2:]).T / 2
    width, height = (vehicle[2:] - vehicle[:2])[:, np.newaxis] / size
    covered = coverage(windows, vehicle[np.newaxis])[:, 0]

    cut = cut_sides(vehicle, frame_width)
    if cut.all():
        fits = shows = np.zeros(len(windows), np.bool_)
    elif cut.any():  # its height and its visible side decide
        visible = sides[:, 2] if cut[0] else -sides[:, 0]
        fits = _between(height, 0.35, 0.85) & (down < 0.16) & (covered > 0.3)
        fits &= _between(visible, 0.3, 0.62)
        shows = _between(height, 0.3, 1) & (down < 0.25) & (covered > 0.12)
        shows &= _between(visible, 0.2, 0.8)
    else:
        fits = _between(width, 0.72, 1.3) & (across < 0.16) & (down < 0.16)
        shows = _between(width, 0.4, 2.5) & (across < 0.45) & (down < 0.25)
    part = (covered > 0.5) & ((width > 2.5) | (height > 1.3)) & ~fits
    overlaps = _between(width, 0.4, 3) & (across < 0.75) & (down < 0.4) & (covered > 0.12)
    sides[:, [0, 2]] = np.where(cut, np.nan, sides[:, [0, 2]])
    distances = np.where(overlaps | fits | shows, np.maximum(across, down), np.inf)
    return WindowComparison(sides, distances, fits, shows & ~fits, part)


def _between(values: Float64Array, low: float, high: float) -> BoolArray:
    return (values > low) & (values < high)


def cut_sides(vehicle: Float64Array, frame_width: int) -> BoolArray:
    """Return whether the left and right side of the frame cut a box `(4,)` off, bool `(2,)`."""
    edge = _EDGE * frame_width
    return np.array([vehicle[0] <= edge, vehicle[2] >= frame_width - edge])
