"""Which paint may belong to the lane's lines: histogram, sliding windows, around a curve."""

import cv2
import numpy as np

from vdet.config.lanes import LaneSettings
from vdet.geometry import Float64Array
from vdet.lanes.curves import Paint
from vdet.lanes.view import View
from vdet.media.images import Image

Guide = tuple[Float64Array, Float64Array]
"""x of the left and of the right line at each row of the view, metres."""


def paint_along(mask: Image, view: View, x: Float64Array, margin: float) -> Paint:
    """Return the paint within `margin` metres of `x` `(rows,)`: the middle of it in each row."""
    half = max(1, round(margin * view.across))
    around = np.arange(-half, half + 1)
    middles = np.clip(np.rint(view.columns(x)), -half - 1, mask.shape[1] + half).astype(np.intp)
    padded = cv2.copyMakeBorder(mask, 0, 0, 2 * half + 1, 2 * half + 1, cv2.BORDER_CONSTANT)
    columns = (middles + 2 * half + 1)[:, None] + around
    band = np.take_along_axis(padded, columns, axis=1) != 0
    counts = band.sum(axis=1)
    rows = np.flatnonzero(counts)
    middle = middles[rows] + (band[rows] @ around) / counts[rows]
    return Paint(view.distances[rows], view.laterals[0] + middle / view.across)


def find_base(mask: Image, view: View, settings: LaneSettings) -> tuple[float, float] | None:
    """Return x of both lines nearby, metres: the best pair of peaks of the histogram.

    The camera is between them, and they are about a lane's width apart. None where there is no
    such pair.
    """
    histogram = _histogram(mask, view, settings)
    wanted, tolerance = settings.view.lane_width, settings.check.width
    least = max(1, round((wanted - tolerance) * view.across))
    most = min(len(histogram) - 1, round((wanted + tolerance) * view.across))
    best, base = 0.0, None
    for gap in range(least, most + 1):
        left, right = view.laterals[:-gap], view.laterals[gap:]
        score = histogram[:-gap] * histogram[gap:] * ((left < 0) & (right > 0))
        peak = int(score.argmax())
        if score[peak] > best:
            best, base = float(score[peak]), (float(left[peak]), float(right[peak]))
    return base


def _histogram(mask: Image, view: View, settings: LaneSettings) -> Float64Array:
    """Return how many of the nearest rows have paint in each column, smoothed."""
    near = view.distances < view.distances[-1] + settings.search.base
    counts = np.count_nonzero(mask[near], axis=0).astype(np.float64)
    spread = round(settings.search.fine_margin * view.across) | 1
    return np.asarray(cv2.blur(counts[None], (spread, 1)), np.float64).ravel()


def slide_windows(
    mask: Image, view: View, base: tuple[float, float], settings: LaneSettings
) -> Guide:
    """Return where windows that slide along both lines, from near to far, come to lie.

    Lines of a lane run alike, so both windows of a step move together, by what the paint in them
    says; where they hold none, they go on as before.
    """
    rows = max(1, round(settings.search.window * view.along))
    places = np.array(base)
    guide = np.empty((2, len(mask)))
    step = 0.0
    for end in range(len(mask), 0, -rows):
        part = np.s_[max(0, end - rows) : end]
        places += step
        shift = _shift(mask[part], view, places, settings.search.margin)
        places += shift
        step += shift / 2  # half of it may be the paint's, not the line's
        guide[:, part] = places[:, None]
    return guide[0], guide[1]


def _shift(part: Image, view: View, places: Float64Array, margin: float) -> float:
    """Return how far the paint in both windows is to the right of their middles, metres."""
    offsets = view.laterals - places[:, None]
    counts = np.count_nonzero(part, axis=0) * (np.abs(offsets) <= margin)
    return float((counts * offsets).sum() / max(1, counts.sum()))
