"""Windows: their positions in a frame, by the horizon of the camera, and their probabilities.

Sets over fixed rows follow the overlap rule of the original system, which places 423 + 408 = 831
windows on a frame of 1280×720. Other sets follow the perspective: on a flat road, a vehicle of
width w stands on the row horizon + w · (height of the camera) / (real width of the vehicle). The
farther away, the smaller it is, and the nearer to the horizon. So the horizon determines the rows
of all sizes. Lane lines, barriers, kerbs and roofs run along the road, so in the image they meet in
its vanishing point, and line segments vote for it (von Gioi et al., "LSD: a Line Segment Detector",
2012).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import Float32Array, Float64Array, Image, Int32Array
from vdet.config.kinds import FeatureSettings, PerspectiveSettings, WindowSettings
from vdet.config.schema import SvmSettings
from vdet.config.section import REFERENCE_HEIGHT, scale_lengths

IndexArray = npt.NDArray[np.intp]

WINDOW_SIDES = np.array([-0.5, -0.5, 0.5, 0.5], np.float32)
"""Sides of a vehicle that fills its window."""

_HIGHEST, _LOWEST = 0.6, 1.1
"""Distance from the horizon down to the bottoms of the highest and lowest windows of a perspective
set, in sides of a window.
"""

_BEYOND = 0.7
"""Fraction of a window of such a set that may be beyond the left or right of the frame."""

_MAX_ASPECT = 16 / 9
"""Wider frames, which show more to the sides, count as having this aspect ratio."""


@dataclass(frozen=True, slots=True)
class Windows:
    """Searched windows, each with the probability that it shows a vehicle.

    Attributes
    ----------
    boxes
        int32 `(n, 4)`: x, y, width, height of the windows, pixels of the frame.
    probabilities
        float32 `(n,)`, 0 to 1.
    weights
        float32 `(n,)`: 1 / number of windows of the same set that cover a pixel.
    vehicles
        float32 `(n, 4)`: x, y, width, height of the vehicle in a window, pixels of the frame. It
        differs from the window only for hits, and only if the model has a box regression.

    Windows and vehicles may extend beyond the frame.
    """

    boxes: Int32Array
    probabilities: Float32Array
    weights: Float32Array
    vehicles: Float32Array

    def __len__(self) -> int:
        return len(self.boxes)

    def hits(self, probability: float) -> "Windows":
        """Return the windows with at least this probability, in the same order."""
        rows = self.probabilities >= probability
        return Windows(
            self.boxes[rows], self.probabilities[rows], self.weights[rows], self.vehicles[rows]
        )


@dataclass(frozen=True, slots=True)
class FrameStrip:
    """A part of a frame, `rows` and `columns`, and its size after resizing, pixels.

    Columns may be outside the frame.
    """

    rows: slice
    columns: slice
    width: int
    height: int


@dataclass(frozen=True, slots=True)
class WindowGrid:
    """The square windows of a set, in columns and rows.

    `size` is the side of a window and `step` the distance to the next one, pixels of the frame. The
    window in column i and row j lies at `left + i·step`, `top + j·step`, rounded to whole pixels.
    """

    size: int
    step: Fraction
    left: Fraction
    top: Fraction
    columns: int
    rows: int

    def __len__(self) -> int:
        return self.columns * self.rows

    @property
    def boxes(self) -> Int32Array:
        """The windows row by row from the top left, int32 `(rows · columns, 4)`."""
        x = [round(self.left + i * self.step) for i in range(self.columns)]
        y = [round(self.top + j * self.step) for j in range(self.rows)]
        boxes = [(i, j, self.size, self.size) for j in y for i in x]
        return np.array(boxes, np.int32).reshape(-1, 4)

    @property
    def weight(self) -> float:
        """1 / number of windows that cover a pixel in the middle of the grid."""
        along = max(1.0, float(self.size / self.step))
        return 1 / (min(self.columns, along) * min(self.rows, along))

    def strip(self, patch: int) -> FrameStrip:
        """Return the strip from the first window to the last, with windows of `patch` pixels."""

        def extent(first: Fraction, count: int) -> tuple[slice, int]:
            start, span = round(first), (count - 1) * self.step + self.size
            return slice(start, start + round(span)), round(span * patch / self.size)

        rows, height = extent(self.top, self.rows)
        columns, width = extent(self.left, self.columns)
        return FrameStrip(rows, columns, width, height)

    def every_nth(self, n: int, column: int, row: int) -> "WindowGrid":
        """Return the grid of every n-th window, from this column and row on."""
        left, top = self.left + column * self.step, self.top + row * self.step
        columns, rows = len(range(column, self.columns, n)), len(range(row, self.rows, n))
        return WindowGrid(self.size, self.step * n, left, top, columns, rows)


def window_grids(
    settings: SvmSettings, features: FeatureSettings, width: int, height: int, *, horizon: float
) -> list[WindowGrid]:
    """Return the grids of all window sets in a frame of `width` × `height` pixels.

    `horizon` is its row, as a fraction of the frame's height. Sets without a fitting window are
    omitted.
    """
    search = scale_lengths(settings.search, height / REFERENCE_HEIGHT)
    grids = [band_grid(window, width, height) for window in search.windows]
    grids += perspective_grids(search.perspective, features, width, height, horizon=horizon)
    return [grid for grid in grids if len(grid)]


def band_grid(settings: WindowSettings, width: int, height: int) -> WindowGrid:
    """Return the windows of a set in its band of rows, over the width of the frame.

    Each product is truncated to a whole number: step = int(size·(1 - overlap)), buffer =
    int(size·overlap), count = int((span - buffer) / step) across and down, or fewer where fewer
    fit.

    Parameters
    ----------
    settings
        Lengths already scaled to the frame (`scale_lengths`).
    width, height
        Pixels; the band ends where the frame does.

    Returns
    -------
    The grid; without windows if the band or the frame is smaller than a window.
    """
    size, top = settings.size, settings.top
    bottom = max(settings.bottom, top + size)  # scaling may have rounded a row away
    spans = width, min(bottom, height) - top
    step = max(1, int(size * (1 - settings.overlap)))
    buffer = int(size * settings.overlap)
    columns, rows = (min((span - buffer) // step, (span - size) // step + 1) for span in spans)
    if not 0 < size <= min(spans):
        columns = rows = 0
    return WindowGrid(size, Fraction(step), Fraction(0), Fraction(top), columns, rows)


def perspective_grids(
    sets: PerspectiveSettings, features: FeatureSettings, width: int, height: int, *, horizon: float
) -> list[WindowGrid]:
    """Return the grids of the perspective sets in a frame of `width` × `height` pixels.

    Windows lie inside the frame's rows, and may reach beyond its left and right. Sizes and first
    rows are rounded so that a set's strip can be halved exactly until a window is about as large as
    a patch.

    Parameters
    ----------
    horizon
        Row of the horizon, fraction of the frame's height.

    Returns
    -------
    One grid for each size, in the same order, without sizes for which no window fits, and without
    sizes that are rounded to the same one.
    """
    cells = features.patch // features.hog.cell
    grids: list[WindowGrid] = []
    for fraction in sets.sizes:
        side = fraction * min(width, _MAX_ASPECT * height)
        halvings = max(0, math.floor(math.log2(max(side, 1) / features.patch)))
        unit = cells << halvings
        size = unit * max(1, round(side / unit))
        first = horizon * height + (_HIGHEST - 1) * size
        top = max(0, round(first / (1 << halvings)) << halvings)
        step = Fraction(size, cells)
        beyond = int(_BEYOND * cells)
        columns = (width + 2 * beyond * step - size) // step + 1
        rows = min(round((_LOWEST - _HIGHEST) * cells) + 1, (height - top - size) // step + 1)
        if size <= width and min(columns, rows) >= 1 and size not in {grid.size for grid in grids}:
            left = -beyond * step
            grids.append(WindowGrid(size, step, left, Fraction(top), int(columns), int(rows)))
    return grids


DEFAULT_HORIZON = 0.58
"""Usual horizon of dashboard cameras, fraction of the height; used if none is found."""

_WIDTH = 640  # pixels of the image in which segments are detected
_MIN_LENGTH = 0.02  # of a segment, fraction of the width
_SLOPES = (12.0, 75.0)  # degrees from the horizontal; vehicles are flatter, poles are steeper
_MAX_SINE = 0.05  # of the angle between a segment and the direction to its vanishing point
_MIN_SEGMENTS = 8  # on each side
_ROWS = np.arange(0.30, 0.75, 0.01)
_COLUMNS = np.arange(0.25, 0.76, 0.02)


def find_horizon(images: Sequence[Image]) -> float | None:
    """Return the row of the horizon, fraction of the frame's height.

    Parameters
    ----------
    images
        Frames of one camera, BGR uint8 `(H, W, 3)`, all of one size.

    Returns
    -------
    0.30 to 0.74 in steps of 0.01; None if too few lines run along the road.
    """
    height, width = images[0].shape[:2]
    ends = np.concatenate([_segment_ends(image) for image in images])
    directions = ends[:, 2:] - ends[:, :2]
    falling = directions[:, 0] * directions[:, 1] > 0
    sides = ends[falling], ends[~falling]
    if min(map(len, sides)) < _MIN_SEGMENTS:
        return None
    left, right = (_sum_votes(side, height / width) for side in sides)
    both = np.minimum(left, right)  # a vanishing point has lines on both sides
    votes = both + 0.2 * (left + right)
    row, _ = np.unravel_index(int(votes.argmax()), votes.shape)
    return round(float(_ROWS[row]), 2) if both.any() else None


def _segment_ends(image: Image) -> Float64Array:
    """Return x, y of both ends of the usable segments, `(n, 4)`, in widths of the frame."""
    height, width = image.shape[:2]
    small = (_WIDTH, max(1, round(height * _WIDTH / width)))
    grey = cv2.cvtColor(cv2.resize(image, small, interpolation=cv2.INTER_AREA), cv2.COLOR_BGR2GRAY)
    lines = cv2.createLineSegmentDetector().detect(grey)[0]
    ends = np.zeros((0, 4)) if lines is None else np.asarray(lines, np.float64).reshape(-1, 4)
    ends = ends / _WIDTH
    across, down = abs(ends[:, 2] - ends[:, 0]), abs(ends[:, 3] - ends[:, 1])
    slopes = np.degrees(np.arctan2(down, across))
    usable = (np.hypot(across, down) > _MIN_LENGTH) & (slopes > _SLOPES[0]) & (slopes < _SLOPES[1])
    return np.asarray(ends[usable])


def _sum_votes(ends: Float64Array, aspect: float) -> Float64Array:
    """Sum the votes of segments, `(n, 4)`, for each point, `(rows, columns)`.

    A segment votes for points above its centre, weighted by its length.
    """
    directions = ends[:, 2:] - ends[:, :2]
    lengths = np.hypot(directions[:, 0], directions[:, 1])
    normals = np.stack([-directions[:, 1], directions[:, 0]], axis=1) / lengths[:, np.newaxis]
    middles = (ends[:, :2] + ends[:, 2:]) / 2
    x, y = np.meshgrid(_COLUMNS, _ROWS * aspect)
    dx, dy = x[..., np.newaxis] - middles[:, 0], y[..., np.newaxis] - middles[:, 1]
    sines = abs(dx * normals[:, 0] + dy * normals[:, 1]) / (np.hypot(dx, dy) + 1e-9)
    votes = lengths * np.maximum(0, 1 - (sines / _MAX_SINE) ** 2) * (dy < 0)
    return np.asarray(votes.sum(axis=-1))
