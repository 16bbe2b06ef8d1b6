"""Trails: where a vehicle was, as a line that grows thinner into the past."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from vdet.boxes import Float64Array
from vdet.draw.paint import Color, Surface, draw_lines

_PARTS = 4
"""Pieces of a trail, each of one width."""
_REACH = 1 / 8
"""Share of a trail, on both sides of a point, over which the point is averaged."""
_SHIFT = 4
"""Bits of the fraction of a pixel that OpenCV draws with."""
_FARTHEST = 2**15
"""Pixels from the picture's corner; OpenCV takes no coordinates much larger."""


def draw_trail(
    surface: Surface, points: Sequence[tuple[float, float]], color: Color, width: int
) -> None:
    """Draw a smooth line along points, the oldest first; it ends at the newest.

    Parameters
    ----------
    surface
        It is changed.
    points
        x, y in pixels; they may lie outside the surface.
    width
        Of the newest part of the line, pixels; the oldest is 1 pixel wide.
    """
    if len(points) < 2:
        return
    line = _smoothed(np.clip(np.asarray(points, np.float64), -_FARTHEST, _FARTHEST))
    fixed = np.rint(line * 2**_SHIFT).astype(np.int32)
    ends = np.linspace(0, len(fixed) - 1, _PARTS + 1).round().astype(int).tolist()
    for part, (first, last) in enumerate(pairwise(ends), start=1):
        if last > first:
            thickness = max(1, round(width * part / _PARTS))
            draw_lines(surface, fixed[first : last + 1], color, thickness, shift=_SHIFT)


def _smoothed(points: Float64Array) -> Float64Array:
    """Average each point `(n, 2)` with as many before it as behind it, fewer near the ends."""
    numbers = np.arange(len(points))
    reach = np.minimum(numbers, numbers[::-1]).clip(max=round(_REACH * len(points)))
    sums = np.concatenate([np.zeros((1, 2)), points.cumsum(axis=0)])
    totals = sums[numbers + reach + 1] - sums[numbers - reach]
    return np.asarray(totals / (2 * reach + 1)[:, np.newaxis])
