"""Window sets that fit the vehicles of a camera: their sizes, and the rows where they stand.

On a flat road the bottom of a vehicle lies the lower in the picture the wider it is, so widths and
bottoms give the horizon. Source of the fit: Theil, "A Rank-invariant Method of Linear and
Polynomial Regression Analysis", 1950, and Sen, 1968.
"""

import numpy as np

from vdet.config.schema import PerspectiveSettings
from vdet.geometry import Float64Array

_FILLED = 0.94  # share of a window's width that its vehicle fills
_RATIO = 1.43  # of a size and the next smaller one, at most
_SLOWER = 1.1  # how much longer the search may take
_TRIES = 30  # smallest sizes that are tried
_TAIL = 0.02  # share of the vehicles that may be smaller, or larger, than any window
_MAX_OUTSIDE = 0.05  # share of the vehicles outside the rows of the base that is no matter
_MARGIN = 0.1  # sides of a window by which the rows reach beyond the vehicles
_FEWEST = 50  # vehicles that are needed to fit anything
_SPREAD = 1.6  # least ratio of large and small vehicles that shows the horizon
_MAX_ASPECT = 16 / 9  # as in vdet.detect.svm.perspective


def fit_windows(
    boxes: Float64Array, size: tuple[int, int], base: PerspectiveSettings, horizon: float
) -> PerspectiveSettings:
    """Return window sets for the vehicles of a camera; `base` where they are too few.

    They suit all vehicles that those of `base` suit. The horizon and the rows are fitted only where
    vehicles lie outside the rows of `base`. Where vehicles are smaller, there are smaller windows,
    as far as the search takes about as long.

    Parameters
    ----------
    boxes
        float64 `(n, 4)`: x, y, width, height of vehicles that no side of the frame cuts off.
    size
        Width and height of the frames, pixels.
    horizon
        Where the search with `base` takes it to be, share of the height.
    """
    if len(boxes) < _FEWEST:
        return base
    width, height = size
    sides = boxes[:, 2] / _FILLED
    fitted = base
    if _outside(boxes, sides, horizon * height, base) > _MAX_OUTSIDE:
        fitted = _fit_rows(boxes, sides, height, base)
    least = float(np.quantile(sides / min(width, _MAX_ASPECT * height), _TAIL)) / base.zoom
    rows = (base.lowest - base.highest) / (fitted.lowest - fitted.highest)
    return fitted.model_copy(update={"sizes": _sizes(least, base.sizes, _SLOWER * rows)})


def _below(boxes: Float64Array, sides: Float64Array, horizon: float) -> Float64Array:
    """Return how far the bottoms of the vehicles' windows lie below the horizon, sides of these."""
    middles = boxes[:, 1] + boxes[:, 3] / 2
    return (middles + sides / 2 - horizon) / sides


def _outside(
    boxes: Float64Array, sides: Float64Array, horizon: float, base: PerspectiveSettings
) -> float:
    """Return the share of vehicles that lie outside the rows of `base`."""
    below = _below(boxes, sides, horizon)
    return float(np.mean((below < base.highest - _MARGIN) | (below > base.lowest + _MARGIN)))


def _fit_rows(
    boxes: Float64Array, sides: Float64Array, height: int, base: PerspectiveSettings
) -> PerspectiveSettings:
    """Return `base` with a horizon and rows for the vehicles, if these show the horizon."""
    horizon = _horizon(boxes, height)
    if horizon is None:
        return base
    highest, lowest = np.quantile(_below(boxes, sides, horizon * height), [_TAIL, 1 - _TAIL])
    return base.model_copy(
        update={
            "horizon": round(horizon, 4),
            "highest": round(max(0.0, float(min(highest - _MARGIN, base.highest))), 2),
            "lowest": round(min(10.0, float(max(lowest + _MARGIN, base.lowest))), 2),
        }
    )


def _sizes(least: float, base: tuple[float, ...], slower: float) -> tuple[float, ...]:
    """Return the sizes of `base`; if vehicles of the size `least` are smaller, sizes down to these.

    The time of the search, for which the sum of their inverses stands, grows by `slower` at most.
    """
    if least >= base[0] or len(base) < 2:
        return base
    allowed = slower * sum(1 / size for size in base)
    for smallest in np.geomspace(least, base[0], _TRIES).tolist():
        for count in range(2 * len(base), 1, -1):
            sizes = np.geomspace(smallest, base[-1], count)
            is_close = sizes[1] / sizes[0] <= _RATIO
            if is_close and np.sum(1 / sizes) <= allowed:
                return tuple(round(size, 4) for size in sizes.tolist())
    return base


def _horizon(boxes: Float64Array, height: int) -> float | None:
    """Return the row of the horizon, share of the height; None where the boxes do not show it."""
    from scipy.stats import theilslopes  # type: ignore[import-untyped]

    widths, bottoms = boxes[:, 2], boxes[:, 1] + boxes[:, 3]
    small, large = np.quantile(widths, [0.1, 0.9])
    if large < _SPREAD * small:
        return None
    some = np.linspace(0, len(boxes) - 1, min(len(boxes), 500)).astype(int)
    slope, row, *_ = theilslopes(bottoms[some], widths[some])
    return float(row) / height if slope > 0 and 0 < row < height else None
