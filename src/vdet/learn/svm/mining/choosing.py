"""Which windows of a labelled frame become patches.

Each window is compared with each vehicle. Lengths are in sides of the window, from its centre. A
vehicle that the left or right side of the frame cuts off is located by its one visible side; where
the other side would be is unknown.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from vdet.boxes import BoolArray, Box, Float64Array, coverage, from_sizes
from vdet.config.schema import MiningSettings
from vdet.detect.svm.windows import Windows
from vdet.learn.svm.dataset import Sides

PatchKind = Literal["vehicle", "box", "false alarm", "part"]
"""`vehicle`: the window fits a vehicle. `box`: it shows one off its centre or of another size.
`false alarm`: it is taken for a vehicle, but there is none. `part`: it is taken for a vehicle, but
shows only a part of one."""

_MAX_COVERED = 0.3
"""Largest share of a false alarm that a vehicle or an ignore region may cover."""

_EDGE = 0.002  # of the frame's width: a box this close to a side of the frame is cut off by it


@dataclass(frozen=True, slots=True, eq=False)
class FrameLabels:
    """The true vehicles and the ignore regions of a frame.

    Both are float64 `(n, 4)`: x1, y1, x2, y2, pixels.
    """

    vehicles: Float64Array
    ignored: Float64Array


@dataclass(frozen=True, slots=True)
class ChosenWindow:
    """A window that becomes a patch, and the sides of the vehicle in it."""

    kind: PatchKind
    box: Box
    sides: Sides | None


def choose_windows(
    windows: Windows,
    labels: FrameLabels,
    frame_width: int,
    settings: MiningSettings,
    rng: np.random.Generator,
) -> Iterator[ChosenWindow]:
    """Choose from the windows of a frame, of each kind as many as the settings allow.

    Parameters
    ----------
    windows
        All windows of the frame, with the probabilities of the model that is to be improved.
    frame_width
        Width of the frame, pixels.
    """
    _, first = np.unique(windows.boxes, axis=0, return_index=True)
    boxes = from_sizes(windows.boxes[first])
    is_hit = windows.probabilities[first] >= settings.probability
    comparisons = [compare_windows(boxes, vehicle, frame_width) for vehicle in labels.vehicles]
    covered = coverage(boxes, np.concatenate([labels.vehicles, labels.ignored]))
    nearest = _nearest_vehicles(comparisons, len(boxes))
    is_alarm = is_hit & (nearest < 0) & (covered <= _MAX_COVERED).all(axis=1)
    is_part = np.zeros(len(boxes), np.bool_)
    for number, comparison in enumerate(comparisons):
        own = nearest == number
        others = np.delete(covered, number, axis=1)
        is_part |= is_hit & comparison.part & (others <= _MAX_COVERED).all(axis=1)
        for row in _sample(comparison.fits & own, settings.per_vehicle, rng):
            yield ChosenWindow("vehicle", Box(*boxes[row].tolist()), _sides(comparison.sides[row]))
        for row in _sample(comparison.shows & own, settings.per_vehicle, rng):
            yield ChosenWindow("box", Box(*boxes[row].tolist()), _sides(comparison.sides[row]))
    for row in _sample(is_alarm, settings.false_alarms, rng):
        yield ChosenWindow("false alarm", Box(*boxes[row].tolist()), None)
    for row in _sample(is_part, settings.parts, rng):
        yield ChosenWindow("part", Box(*boxes[row].tolist()), None)


@dataclass(frozen=True, slots=True, eq=False)
class WindowComparison:
    """What `n` windows show of one vehicle.

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
    width, height = vehicle[2:] - vehicle[:2]
    sides = (vehicle - np.tile(middle, 2)) / size[:, np.newaxis]
    measures = _Measures(
        abs(sides[:, 0] + sides[:, 2]) / 2,
        abs(sides[:, 1] + sides[:, 3]) / 2,
        width / size,
        height / size,
        coverage(windows, vehicle[np.newaxis])[:, 0],
    )
    cut = cut_sides(vehicle, frame_width)
    if cut.all():
        fits = shows = np.zeros(len(windows), np.bool_)
    elif cut.any():
        fits, shows = _compare_cut(measures, sides[:, 2] if cut[0] else -sides[:, 0])
    else:
        fits, shows = _compare_whole(measures)
    sides[:, [0, 2]] = np.where(cut, np.nan, sides[:, [0, 2]])
    near = measures.near | fits | shows
    distances = np.maximum(measures.across, measures.down)
    return WindowComparison(sides, distances, fits, shows & ~fits, measures.part & ~fits, near)


def cut_sides(vehicle: Float64Array, frame_width: int) -> BoolArray:
    """Return whether the left and right side of the frame cut a box `(4,)` off, bool `(2,)`."""
    edge = _EDGE * frame_width
    return np.array([vehicle[0] <= edge, vehicle[2] >= frame_width - edge])


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


def _compare_whole(measures: _Measures) -> tuple[BoolArray, BoolArray]:
    """Return the flags `fits` and `shows` for a vehicle that lies in the frame."""
    width, across, down = measures.width, measures.across, measures.down
    fits = (width > 0.72) & (width < 1.3) & (across < 0.16) & (down < 0.16)
    shows = (width > 0.4) & (width < 2.5) & (across < 0.45) & (down < 0.25)
    return fits, shows


def _compare_cut(measures: _Measures, visible: Float64Array) -> tuple[BoolArray, BoolArray]:
    """Return the flags for a vehicle that the frame cuts off.

    They depend on its height and on `visible`, the distance of its visible side from the centre.
    """
    height, down, covered = measures.height, measures.down, measures.covered
    fits = (height > 0.35) & (height < 0.85) & (down < 0.16) & (covered > 0.3)
    shows = (height > 0.3) & (height < 1) & (down < 0.25) & (covered > 0.12)
    return fits & (visible > 0.3) & (visible < 0.62), shows & (visible > 0.2) & (visible < 0.8)


def _nearest_vehicles(comparisons: list[WindowComparison], count: int) -> npt.NDArray[np.intp]:
    """Return the number of the vehicle nearest to each window, -1 if none is near."""
    distances = np.full((len(comparisons) + 1, count), np.inf)
    for number, comparison in enumerate(comparisons, start=1):
        distances[number, comparison.near] = comparison.distances[comparison.near]
    return np.asarray(distances.argmin(axis=0) - 1)


def _sample(flags: BoolArray, most: int, rng: np.random.Generator) -> list[int]:
    """Return at most `most` of the flagged rows, at random, in order."""
    (rows,) = np.nonzero(flags)
    return sorted(rng.permutation(rows)[:most].tolist())


def _sides(row: Float64Array) -> Sides:
    left, top, right, bottom = (None if np.isnan(side) else float(side) for side in row)
    return left, top, right, bottom
