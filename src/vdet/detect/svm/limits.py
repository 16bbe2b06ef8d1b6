"""The part of a window set that is searched where vehicles are looked for in an area only."""

import math
from fractions import Fraction

import numpy as np

from vdet.boxes import Int64Array, from_sizes
from vdet.config.schema import FeatureSettings
from vdet.detect.svm.windows import WindowGrid
from vdet.regions import SearchArea

_MARGIN = Fraction(1, 2)
"""Windows this near the area are searched too, sides of a window: they show parts of the vehicles
in the area, and add to their heat."""

ALIGNMENT = 16
"""The part begins so many pixels, or a multiple, after the set: then its strips are scaled as those
of the whole set are, and its windows look the same."""


def limited_grid(
    grid: WindowGrid, area: SearchArea, features: FeatureSettings
) -> WindowGrid | None:
    """Return the smallest grid with all windows in or near an area; None where there are none.

    The windows of the area have the same pixels, and so the same features, as those of `grid`.
    """
    margin = math.ceil(max(_MARGIN * grid.size, grid.step))
    grown = from_sizes(grid.boxes) + np.array([-margin, -margin, margin, margin])
    touched = area.touches(grown).reshape(grid.rows, grid.columns)
    if not touched.any():
        return None
    cells = grid.step * features.patch / grid.size / features.hog.cell
    period = math.lcm((grid.step / ALIGNMENT).denominator, cells.denominator)
    row, rows = _span(np.flatnonzero(touched.any(axis=1)), period)
    column, columns = _span(np.flatnonzero(touched.any(axis=0)), period)
    left, top = grid.left + column * grid.step, grid.top + row * grid.step
    return WindowGrid(grid.size, grid.step, left, top, columns, rows)


def _span(numbers: Int64Array, period: int) -> tuple[int, int]:
    """Return the first of some numbers, down to a multiple of `period`, and the count from it."""
    first = int(numbers[0]) // period * period
    return first, int(numbers[-1]) + 1 - first
