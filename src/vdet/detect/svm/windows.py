"""The windows of a frame: their positions, by the horizon of the camera, and their dense search.

Sets over fixed rows follow the overlap rule of the original system, which places 423 + 408 = 831
windows on a frame of 1280×720. Other sets follow the perspective: on a flat road, a vehicle of
width w stands on the row horizon + w · (height of the camera) / (real width of the vehicle). The
farther away, the smaller it is, and the nearer to the horizon. So the horizon determines the rows
of all sizes. Lane lines, barriers, kerbs and roofs run along the road, so in the image they meet in
its vanishing point, and line segments vote for it (von Gioi et al., "LSD: a Line Segment Detector",
2012).

Features are computed once for a strip of the frame: the area of a grid, at the scale at which a
window is a patch. Windows at distances of whole cells share its HOG blocks (`Blocks`), which is
fast; this includes the perspective sets. If this holds for every second window of a grid, it is
searched as four such grids. Windows of other grids share only the gradients of the strip
(`Gradients`), such as those of 128 pixels of the original. All windows share sums over pixels
(`table_sums`).
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
from vdet.detect.svm.model import Channels, LinearModel, halve, hog_descriptors, resize, split
from vdet.media import Picture

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

DEFAULT_HORIZON = 0.58
"""Usual horizon of dashboard cameras, fraction of the height; used if none is found."""

_WIDTH = 640  # pixels of the image in which segments are detected
_MIN_LENGTH = 0.02  # of a segment, fraction of the width
_SLOPES = (12.0, 75.0)  # degrees from the horizontal; vehicles are flatter, poles are steeper
_MAX_SINE = 0.05  # of the angle between a segment and the direction to its vanishing point
_MIN_SEGMENTS = 8  # on each side
_ROWS = np.arange(0.30, 0.75, 0.01)
_COLUMNS = np.arange(0.25, 0.76, 0.02)

_MIN_SIDE = 0.2  # minimum side of a vehicle in a window, sides of the window

MAX_PHASES = 2
"""Maximum number of grids with shared blocks, across and down, that a grid is split into; with
more, sharing only the gradients is faster.
"""

BATCH = 8192
"""Maximum number of windows whose vectors are in memory at once."""


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


class FramePyramid:
    """The searched rows of one frame at full size and, on demand, at half, quarter … size.

    It has luma, red and blue if the picture has planes, with chroma at half size. Otherwise it has
    BGR, which is converted last, as in training.

    Parameters
    ----------
    picture
        Upright, H × W pixels.
    features
        Determine which channels are halved.
    top, bottom
        First row to search, even; first row below, None for the end of the frame.
    margin
        Even number of columns to search beyond the left and right of the frame; they repeat the
        outermost columns.
    """

    def __init__(
        self,
        picture: Picture,
        features: FeatureSettings,
        top: int = 0,
        bottom: int | None = None,
        margin: int = 0,
    ) -> None:
        self._features = features
        self._origin = margin, -top
        rows = slice(top, picture.height if bottom is None else bottom)
        self._levels = _levels(picture, rows, margin)

    def cut(self, strip: FrameStrip) -> Channels:
        """Return a strip of the frame, resized.

        Each channel, or BGR, equals `resize(channel[rows, columns], width, height)`. Halvings are
        shared by all cuts.
        """
        across, down = self._origin
        rows, columns = strip.rows, strip.columns
        sides = rows.start + down, rows.stop + down, columns.start + across, columns.stop + across
        if len(self._levels) == 1:
            return split(self._levels[0].cut(sides, strip.width, strip.height), self._features)
        luma, red, blue = (
            levels.cut(sides, strip.width // shrink, strip.height // shrink)
            for levels, shrink in zip(
                self._levels, map(self._features.shrink, range(3)), strict=True
            )
        )
        return luma, red, blue


class _Levels:
    """A channel, or BGR, at full, half, quarter … size, made from its data at `level`."""

    def __init__(self, channel: Image, level: int = 0) -> None:
        self._levels = {level: channel}

    def cut(self, sides: tuple[int, int, int, int], width: int, height: int) -> Image:
        """Return the part between top, bottom, left and right, resized to `width` × `height`."""
        level = 0
        top, bottom, left, right = sides
        while (
            not any(side % 2 for side in (top, bottom, left, right))
            and bottom - top >= 2 * height
            and right - left >= 2 * width
        ):
            top, bottom, left, right = top // 2, bottom // 2, left // 2, right // 2
            level += 1
        return resize(self._at(level)[top:bottom, left:right], width, height)

    def _at(self, level: int) -> Image:
        """Return the channel, halved `level` times."""
        if level not in self._levels:
            self._levels[level] = _halved(self._at(level - 1)) if level else _doubled(self._at(1))
        return self._levels[level]


def _levels(picture: Picture, rows: slice, margin: int) -> list[_Levels]:
    """Return luma, red and blue of the rows, or BGR."""
    first, *chroma = picture.rows(rows)
    halves = [_Levels(_widened(item, margin // 2), level=1) for item in reversed(chroma)]
    return [_Levels(_widened(first, margin)), *halves]


def _widened(values: Image, margin: int) -> Image:
    edge = cv2.BORDER_REPLICATE
    return np.asarray(cv2.copyMakeBorder(values, 0, 0, margin, margin, edge), np.uint8)


def _halved(values: Image) -> Image:
    height, width = values.shape[:2]
    return halve(values[: height // 2 * 2, : width // 2 * 2])


def _doubled(values: Image) -> Image:
    height, width = values.shape
    return np.asarray(
        cv2.resize(values, (2 * width, 2 * height), interpolation=cv2.INTER_NEAREST), np.uint8
    )


_Part = tuple[IndexArray, FrameStrip, IndexArray, IndexArray]
"""`n` windows of a grid that lie at whole pixels of one strip: their numbers in the grid, the
strip, and the top-left pixels in it, x and y.
"""


class DenseSearch:
    """Searches the windows of one grid, split into parts whose windows lie on the same strip."""

    def __init__(self, model: LinearModel, grid: WindowGrid) -> None:
        features = model.features
        pixels = grid.step * features.patch / grid.size  # from window to window, of the patch
        self._hog: type[Blocks | Gradients] = Blocks
        n = (pixels / features.hog.cell).denominator
        if n > MAX_PHASES:
            self._hog = Gradients
            n = (pixels / max(map(features.shrink, range(3)))).denominator
        self._model, self._count = model, len(grid)
        self._weights, color_weights = np.split(model.weights, [features.hog_length], axis=1)
        bins = features.histogram.bins
        self._tables = np.repeat(color_weights.reshape(-1, 3, bins), 256 // bins, axis=2)
        self._parts = [
            _part(grid, features.patch, n, column, row)
            for row in range(min(n, grid.rows))
            for column in range(min(n, grid.columns))
        ]

    def search(self, frame: FramePyramid, probability: float) -> tuple[Float32Array, Float32Array]:
        """Search a frame; windows with at least this probability are hits.

        Returns
        -------
        Of each window, in the order of `WindowGrid.boxes`: its probability, float32 `(n,)`; left,
        top, right and bottom of the vehicle from the centre of the window, in sides of it, float32
        `(n, 4)`. They are `WINDOW_SIDES` for windows that are not hits, and without box regression.
        """
        model, features = self._model, self._model.features
        probabilities = np.zeros(self._count, np.float32)
        sides = np.tile(WINDOW_SIDES, (self._count, 1))
        for numbers, area, x, y in self._parts:
            strip = frame.cut(area)
            hog = self._hog(strip, features)
            values = table_sums(strip, self._tables, features, x, y)
            values += hog.values(self._weights, x, y)
            probabilities[numbers] = model.to_probabilities(values + model.biases)
            hits = probabilities[numbers] >= probability
            if model.box_regression is not None and hits.any():
                vectors = hog.vectors(x[hits], y[hits])
                sides[numbers[hits]] = model.box_regression.sides(vectors)
        return probabilities, sides


def _part(grid: WindowGrid, patch: int, n: int, column: int, row: int) -> _Part:
    """Return every n-th window, from this column and row on."""
    numbers = np.arange(len(grid)).reshape(grid.rows, grid.columns)[row::n, column::n]
    pixels = int(n * grid.step * patch / grid.size)
    y, x = np.indices(numbers.shape).reshape(2, -1) * pixels
    return numbers.ravel(), grid.every_nth(n, column, row).strip(patch), x, y


class Blocks:
    """HOG of windows at distances of whole cells: each block of the strip is computed once.

    `x` and `y`, `(n,)`, are the top-left pixels of windows in the strip.
    """

    def __init__(self, strip: Channels, features: FeatureSettings) -> None:
        self._features = features
        cell, block = features.hog.cell, features.hog.block
        height, width = (side * features.shrink(0) for side in strip[0].shape)
        columns, rows = (side // cell - block + 1 for side in (width, height))
        # A descriptor whose window is the strip gives each block once, column by column.
        pairs = zip(hog_descriptors(features, width, height), strip, strict=True)
        blocks = [np.reshape(hog.compute(item), (columns, rows, -1)) for hog, item in pairs]
        self._blocks = np.concatenate(blocks, axis=-1, dtype=np.float32)

    def vectors(self, x: IndexArray, y: IndexArray) -> Float32Array:
        """Return the HOG of windows as `describe` orders it, float32 `(n, h)`."""
        steps = np.arange(self._features.blocks)
        columns = self._cells(x)[:, np.newaxis, np.newaxis] + steps[:, np.newaxis]
        rows = self._cells(y)[:, np.newaxis, np.newaxis] + steps
        by_block = self._blocks[columns, rows].reshape(len(x), len(steps) ** 2, 3, -1)
        return np.asarray(by_block.swapaxes(1, 2).reshape(len(x), -1), np.float32)

    def values(self, weights: Float32Array, x: IndexArray, y: IndexArray) -> Float32Array:
        """Return the HOG of windows times weights, `(m, h)` → float32 `(n, m)`."""
        # A matrix product weights every block as if it lay at each position (i, j) of a window.
        columns, rows, length = self._blocks.shape
        side, count = self._features.blocks, len(weights)
        by_position = weights.reshape(count, 3, side**2, -1).swapaxes(1, 2).reshape(-1, length)
        planes = by_position @ self._blocks.reshape(-1, length).T
        planes = planes.reshape(count, side, side, columns * rows)
        # Block (i, j) of the window that begins at block k is block k + i·rows + j.
        last = columns * rows - side + 1
        down = np.zeros((count, side, last), np.float32)
        for j in range(side):
            down += planes[:, :, j, j : j + last]
        last -= (side - 1) * rows
        sums = np.zeros((count, last), np.float32)
        for i in range(side):
            sums += down[:, i, i * rows : i * rows + last]
        return sums[:, self._cells(x) * rows + self._cells(y)].T

    def _cells(self, pixels: IndexArray) -> IndexArray:
        return pixels // self._features.hog.cell


class Gradients:
    """HOG of windows at any pixels: only gradients are shared (`HOGDescriptor.compute`)."""

    def __init__(self, strip: Channels, features: FeatureSettings) -> None:
        self._strip, self._features = strip, features
        self._descriptors = hog_descriptors(features, features.patch, features.patch)

    def vectors(self, x: IndexArray, y: IndexArray) -> Float32Array:
        """Return the HOG of windows as `describe` orders it, float32 `(n, h)`."""
        parts = []
        for number, (hog, channel) in enumerate(zip(self._descriptors, self._strip, strict=True)):
            corners = np.stack([x, y], axis=1) // self._features.shrink(number)
            vectors = hog.compute(channel, locations=list(map(tuple, corners.tolist())))
            parts.append(np.reshape(vectors, (len(x), -1)))
        return np.concatenate(parts, axis=1, dtype=np.float32)

    def values(self, weights: Float32Array, x: IndexArray, y: IndexArray) -> Float32Array:
        """Return the HOG of windows times weights, `(m, h)` → float32 `(n, m)`."""
        batches = (slice(first, first + BATCH) for first in range(0, len(x), BATCH))
        return np.concatenate([self.vectors(x[some], y[some]) @ weights.T for some in batches])


def table_sums(
    strip: Channels, tables: Float32Array, features: FeatureSettings, x: IndexArray, y: IndexArray
) -> Float32Array:
    """Return the colour histograms of windows times weights, as sums over pixels.

    Parameters
    ----------
    tables
        float32 `(m, 3, 256)`: contribution of a pixel by channel and value.
    x, y
        Top-left pixels of the windows in the strip, `(n,)`.

    Returns
    -------
    float32 `(n, m)`.
    """
    sums = np.zeros((len(x), len(tables)), np.float32)
    for number, channel in enumerate(strip):
        shrink = features.shrink(number)
        left, top, side = x // shrink, y // shrink, features.patch // shrink
        for row, table in enumerate(tables[:, number]):
            integral = np.asarray(cv2.integral(cv2.LUT(channel, table)))
            lower = integral[top + side, left + side] - integral[top + side, left]
            sums[:, row] += lower - integral[top, left + side] + integral[top, left]
    return sums


def vehicle_boxes(windows: Float32Array, sides: Float32Array) -> Float32Array:
    """Return the boxes of vehicles in windows, `(m, 4)` of x, y, width, height.

    Parameters
    ----------
    windows
        `(m, 4)` of x, y, width, height.
    sides
        `(m, 4)` of left, top, right, bottom, measured from the centre of the window in its sides.
    """
    size = windows[:, 2:]
    middle = windows[:, :2] + size / 2
    extent = np.maximum(sides[:, 2:] - sides[:, :2], _MIN_SIDE)
    centre = middle + (sides[:, :2] + sides[:, 2:]) / 2 * size
    return np.concatenate([centre - extent * size / 2, extent * size], axis=1, dtype=np.float32)
