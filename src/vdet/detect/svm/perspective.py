"""Window sets that follow the perspective: how large a vehicle looks tells where it stands.

On a flat road, what stands on the ground ends as far below the horizon as the camera stands above
the ground, both in widths of the thing, whatever its distance. So one number, the horizon, places
all sets.
"""

import math
from fractions import Fraction

from vdet.config.schema import FeatureSettings, PerspectiveSettings
from vdet.detect.svm.windows import WindowGrid

_WIDEST = 16 / 9
"""Of a wider frame, this share of its height counts as its width: it shows more to the sides."""


def lay_perspective(
    settings: PerspectiveSettings,
    features: FeatureSettings,
    width: int,
    height: int,
    *,
    horizon: float,
) -> list[WindowGrid]:
    """Lay the sets over a frame of `width` × `height` pixels.

    Windows lie inside the frame's rows, and may reach beyond its sides. Sizes and first rows are
    rounded so that a set's strip can be halved exactly until it is near a patch in scale.

    Parameters
    ----------
    horizon
        Its row, share of the frame's height.

    Returns
    -------
    A grid a size, in the order given; sizes of which no window fits are left out, and those that
    are rounded to one before them.
    """
    cells = features.patch // features.hog.cell
    grids: list[WindowGrid] = []
    for share in settings.sizes:
        side = share * settings.zoom * min(width, _WIDEST * height)
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
