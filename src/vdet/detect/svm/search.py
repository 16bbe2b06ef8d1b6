"""The dense search of a window set in a frame.

Features are computed once for a strip of the frame: the area of a grid, at the scale at which a
window is a patch. Windows at distances of whole cells share its HOG blocks (`Blocks`), which is
fast; this includes the perspective sets. If this holds for every second window of a grid, it is
searched as four such grids. Windows of other grids share only the gradients of the strip
(`Gradients`), such as those of 128 pixels of the original. All windows share sums over pixels
(`table_sums`).
"""

import cv2
import numpy as np

from vdet.boxes import Float32Array, Image
from vdet.config.kinds import FeatureSettings
from vdet.detect.svm.model import Channels, LinearModel, halve, hog_descriptors, resize, split
from vdet.detect.svm.windows import WINDOW_SIDES, FrameStrip, IndexArray, WindowGrid
from vdet.media import Picture


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


_MIN_SIDE = 0.2  # minimum side of a vehicle in a window, sides of the window


MAX_PHASES = 2
"""Maximum number of grids with shared blocks, across and down, that a grid is split into; with
more, sharing only the gradients is faster.
"""

BATCH = 8192
"""Maximum number of windows whose vectors are in memory at once."""


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
