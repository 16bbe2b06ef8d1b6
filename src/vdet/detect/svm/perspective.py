"""Window sets that follow the perspective: the size of a vehicle gives its row.

On a flat road, a vehicle of width w stands on the row horizon + w · (height of the camera) /
(real width of the vehicle): the farther, the smaller and the nearer to the horizon. So the horizon
alone places the sets of all sizes.
"""

import math
from fractions import Fraction

from vdet.config.schema import FeatureSettings, PerspectiveSettings
from vdet.detect.svm.windows import WindowGrid

_MAX_ASPECT = 16 / 9
"""A frame that is wider shows more to the sides; its height times this counts as its width."""


def lay_perspective(
    settings: PerspectiveSettings,
    features: FeatureSettings,
    width: int,
    height: int,
    *,
    horizon: float,
) -> list[WindowGrid]:
    """Lay the sets over a frame of `width` × `height` pixels.

    Windows lie inside the frame's rows, and may reach beyond its left and right. Sizes and first
    rows are rounded so that a set's strip can be halved exactly until a window is about as large as
    a patch.

    Parameters
    ----------
    horizon
        Row of the horizon, share of the frame's height.

    Returns
    -------
    One grid for each size, in the order given. Sizes of which no window fits are left out; of
    several sizes that are rounded to the same one, the first is laid.
    """
    cells = features.patch // features.hog.cell
    grids: list[WindowGrid] = []
    for share in settings.sizes:
        side = share * settings.zoom * min(width, _MAX_ASPECT * height)
        halvings = max(0, math.floor(math.log2(max(side, 1) / features.patch)))
        unit = cells << halvings
        size = unit * max(1, round(side / unit))
        first = horizon * height + (settings.highest - 1) * size
        top = max(0, round(first / (1 << halvings)) << halvings)
        step = Fraction(settings.step * size, cells)
        beyond = int(Fraction(settings.beyond) * size / step)
        columns = (width + 2 * beyond * step - size) // step + 1
        wanted = round((settings.lowest - settings.highest) * size / step) + 1
        rows = min(wanted, (height - top - size) // step + 1)
        if size <= width and min(columns, rows) >= 1 and size not in {grid.size for grid in grids}:
            left = -beyond * step
            grids.append(WindowGrid(size, step, left, Fraction(top), int(columns), int(rows)))
    return grids
