"""Painted pixels of the top view: which pixels are paint, and which may belong to the lane.

A painted line has the same width at all distances in the top view. A pixel counts as paint if it
is lighter or yellower than the road a little to its left *and* a little to its right. At the edge
of a shadow, a kerb or pale concrete only one side is darker. Lightness is compared relative to the
road's own, so a line in a shadow is found too. Yellow paint differs from pale concrete by colour.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from vdet.boxes import Box, Float64Array, Image
from vdet.lanes.top_view import ACROSS, ALONG, TopView

LinePositions = tuple[Float64Array, Float64Array]
"""x of the left and of the right line at each row of the top view, metres, each `(rows,)`."""


@dataclass(frozen=True, slots=True)
class LinePaint:
    """Painted rows that may belong to one line: distances and lateral positions, metres `(n,)`."""

    z: Float64Array
    x: Float64Array
    visible: float = 1.0
    """Fraction of all rows in which no vehicle hides the line."""


PAINT, HIDDEN = 255, 128
"""Values of a mask of paint: paint, and what a vehicle hides; the rest is 0."""

MARGIN = 0.5
"""Largest distance of paint from the middle of its window or the last frame's curve, metres."""
FINE_MARGIN = 0.2
"""Largest distance of paint from a curve that was fitted to this frame, metres."""
WIDTH_TOLERANCE = 0.6
"""Largest difference between the width of the lane and `lanes.lane_width`, metres."""

_LINE_WIDTH = 0.15
"""Width of a painted line, metres."""
_REACH = 0.35
"""Distance to the road on the left and right with which a pixel is compared, metres."""
_RISE, _LEAST_RISE = 0.10, 10.0
"""Minimum rise in lightness from the road to paint: fraction of the road's, and of 0 to 255."""
_LEAST_RISES = np.maximum(np.arange(256) * np.float32(_RISE), _LEAST_RISE).astype(np.uint8)
"""The minimum rise in whole values, by the lightness of the road."""
_YELLOW = 9.0
"""Minimum fall in blue chroma from the road to yellow paint, of 0 to 255."""
_BASE = 15.0
"""Length of the nearest part of the road, which the histogram covers, metres."""
_WINDOW = 3.0
"""Length of a sliding window, metres."""


def paint_mask(luma: Image, blue: Image) -> Image:
    """Return 255 for paint and 0 for the rest, uint8 `(rows, columns)`.

    `luma` and `blue` chroma are those of the road from above, uint8 `(rows, columns)`, in the
    common coding.
    """
    width = round(_LINE_WIDTH * ACROSS) | 1  # odd, so that the blur does not shift lines
    reach = round(_REACH * ACROSS)
    lightness, yellow = (
        np.asarray(cv2.blur(item, (width, 3)), np.uint8) for item in (luma, cv2.bitwise_not(blue))
    )
    road = _larger_side(lightness, reach)
    rise = cv2.subtract(lightness, road)  # saturates at 0
    tint = cv2.subtract(yellow, _larger_side(yellow, reach))
    paint = cv2.compare(rise, cv2.LUT(road, _LEAST_RISES), cv2.CMP_GT)
    _, yellow_paint = cv2.threshold(tint, _YELLOW, PAINT, cv2.THRESH_BINARY)
    return np.asarray(cv2.bitwise_or(paint, yellow_paint), np.uint8)


def _larger_side(channel: Image, reach: int) -> Image:
    """Return the larger of the values `reach` columns to the left and to the right."""
    padded = cv2.copyMakeBorder(channel, 0, 0, reach, reach, cv2.BORDER_CONSTANT, value=(255,))
    columns = channel.shape[1]
    return np.asarray(cv2.max(padded[:, :columns], padded[:, 2 * reach :]), np.uint8)


def hide(mask: Image, top_view: TopView, boxes: Iterable[Box]) -> Image:
    """Return the mask with `HIDDEN` where vehicles, boxes in the undistorted frame, hide the road.

    Seen from above, they stretch over everything behind them.
    """
    farthest = top_view.outline[:, 1].min()
    hidden = mask.copy()
    for box in boxes:
        x1, x2 = box.x1 - 0.5, box.x2 - 0.5
        y1, y2 = max(box.y1 - 0.5, farthest), box.y2 - 0.5
        if y1 < y2:
            corners = np.array([[x1, y1], [x2, y1], [x2, y2], [x1, y2]])
            outline = np.rint(top_view.frame_to_top(corners)).astype(np.int32)
            cv2.fillConvexPoly(hidden, outline, (HIDDEN,))
    return hidden


def paint_along(
    mask: Image, top_view: TopView, lines: Sequence[Float64Array], margin: float
) -> list[LinePaint]:
    """Return, for each line, the middle of its paint in each row, within `margin` metres of it.

    Each of `lines` is the x of one line in each row, metres `(rows,)`. A row is left out if a part
    of it is hidden near the line: the middle of the rest would be wrong.
    """
    half = max(1, round(margin * ACROSS))
    around = np.arange(-half, half + 1)
    columns = np.rint(top_view.columns(np.stack(lines)))
    middles = np.clip(columns, -half - 1, mask.shape[1] + half).astype(np.intp)
    padded = cv2.copyMakeBorder(mask, 0, 0, 2 * half + 1, 2 * half + 1, cv2.BORDER_CONSTANT)
    first = np.arange(len(mask)) * padded.shape[1] + 2 * half + 1
    near = np.asarray(padded, np.uint8).ravel()[(middles + first)[..., None] + around]
    visible = (near != HIDDEN).all(axis=2)
    # one product counts the painted columns and adds up their offsets
    weights = np.stack([np.ones_like(around), around], axis=1, dtype=np.float32)
    counts, moments = np.moveaxis((near == PAINT).astype(np.float32) @ weights, 2, 0)
    x = top_view.laterals[0] + (middles + moments / np.maximum(counts, 1)) / ACROSS
    return [
        LinePaint(top_view.distances[rows], of_line[rows], float(seen.mean()))
        for of_line, rows, seen in zip(x, (counts > 0) & visible, visible, strict=True)
    ]


def find_base(mask: Image, top_view: TopView) -> tuple[float, float] | None:
    """Return x of both lines near the camera, metres: the best pair of peaks in the histogram.

    The pair has one line on each side of the camera, about a lane's width apart. None if there is
    no such pair.
    """
    near = top_view.distances < top_view.distances[-1] + _BASE
    counts = np.count_nonzero(mask[near] == PAINT, axis=0).astype(np.float64)
    spread = round(FINE_MARGIN * ACROSS) | 1
    histogram = np.asarray(cv2.blur(counts[None], (spread, 1)), np.float64).ravel()
    expected = top_view.lane_width
    minimum, most = (
        round((expected + off) * ACROSS) for off in (-WIDTH_TOLERANCE, WIDTH_TOLERANCE)
    )
    best, base = 0.0, None
    for gap in range(max(1, minimum), most + 1):
        left, right = top_view.laterals[:-gap], top_view.laterals[gap:]
        score = histogram[:-gap] * histogram[gap:] * ((left < 0) & (right > 0))
        peak = int(score.argmax())
        if score[peak] > best:
            best, base = float(score[peak]), (float(left[peak]), float(right[peak]))
    return base


def slide_windows(mask: Image, top_view: TopView, base: tuple[float, float]) -> LinePositions:
    """Follow both lines with sliding windows, from near to far; return the windows' middles.

    The lines of a lane run in parallel, so both windows of a step move together, by the paint in
    either. Windows without paint move on as before.
    """
    rows = max(1, round(_WINDOW * ALONG))
    middles = np.array(base)
    positions = np.empty((2, len(mask)))
    step = 0.0
    for end in range(len(mask), 0, -rows):
        part = np.s_[max(0, end - rows) : end]
        middles += step
        offsets = top_view.laterals - middles[:, None]
        counts = np.count_nonzero(mask[part] == PAINT, axis=0) * (np.abs(offsets) <= MARGIN)
        shift = float((counts * offsets).sum() / max(1, counts.sum()))
        middles += shift
        step += shift / 2  # damped: part of the shift may be noise
        positions[:, part] = middles[:, None]
    return positions[0], positions[1]
