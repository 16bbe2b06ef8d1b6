"""A picture of patches and their features: channels, HOG of each, histogram of each."""

import math

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import Float64Array
from vdet.config.svm import FeatureSettings
from vdet.detect.svm.features import histogram, hog_descriptor, split, to_patch
from vdet.draw.boxes import WHITE
from vdet.media.images import Image

TILE = 192
_BACKGROUND = 32


def patch_sheet(patches: dict[str, Image], settings: FeatureSettings) -> Image:
    """Return a row of tiles for each patch: itself, its channels, their HOG, their histograms.

    Parameters
    ----------
    patches
        Caption → BGR uint8 crop of any size.
    """
    return np.vstack([_row(name, crop, settings) for name, crop in patches.items()])


def _row(name: str, crop: Image, settings: FeatureSettings) -> Image:
    patch = to_patch(crop, settings.patch)
    channels = split(patch, settings)
    tiles = [_captioned(_enlarged(patch), name)]
    for i, channel in enumerate(channels):
        gray = np.asarray(cv2.cvtColor(channel, cv2.COLOR_GRAY2BGR), np.uint8)
        tiles.append(_captioned(_enlarged(gray), f"{settings.color_space} [{i}]"))
    tiles += [
        _captioned(_hog_tile(channels[i], settings, i), f"HOG [{i}]") for i in settings.hog.channels
    ]
    if bins := settings.histogram.bins:
        counts = np.stack([histogram(np.asarray(c, np.uint8), bins) for c in channels])
        tiles.append(_captioned(_histogram_tile(counts), f"histogram, {bins} bins"))
    return np.hstack(tiles)


def _enlarged(image: Image) -> Image:
    return np.asarray(cv2.resize(image, (TILE, TILE), interpolation=cv2.INTER_NEAREST), np.uint8)


def _captioned(tile: Image, text: str) -> Image:
    framed = cv2.copyMakeBorder(tile, 28, 4, 4, 4, cv2.BORDER_CONSTANT, value=(_BACKGROUND,) * 3)
    cv2.putText(framed, text, (6, 19), cv2.FONT_HERSHEY_SIMPLEX, 0.45, WHITE, 1, cv2.LINE_AA)
    return np.asarray(framed, np.uint8)


def _hog_tile(channel: Image, settings: FeatureSettings, number: int) -> Image:
    """Draw each cell's edges as lines; a stronger gradient makes a brighter line."""
    tile = np.zeros((TILE, TILE, 3), np.uint8)
    strengths = _cell_strengths(channel, settings, number)
    _, columns, orientations = strengths.shape
    size = TILE / columns
    for row, column, k in np.argwhere(strengths > 0.05 * strengths.max()).tolist():
        # The edge lies across the gradient.
        angle = math.pi * (k + 0.5) / orientations + math.pi / 2
        dx, dy = math.cos(angle) * size * 0.45, math.sin(angle) * size * 0.45
        x, y = (column + 0.5) * size, (row + 0.5) * size
        shade = round(255 * float(strengths[row, column, k] / strengths.max()))
        ends = (round(x - dx), round(y - dy)), (round(x + dx), round(y + dy))
        cv2.line(tile, *ends, (shade, shade, shade), 1, cv2.LINE_AA)
    return tile


def _cell_strengths(channel: Image, settings: FeatureSettings, number: int) -> Float64Array:
    """Average each cell over its blocks; float64 `(rows, columns, orientations)`."""
    hog = settings.hog
    cells, blocks = settings.patch // hog.cell, settings.patch // hog.cell - hog.block + 1
    vector = hog_descriptor(settings, (settings.patch,) * 2, number).compute(channel)
    # axes: block column, block row, cell column, cell row, orientation
    values = np.reshape(vector, (blocks, blocks, hog.block, hog.block, hog.orientations))
    total = np.zeros((cells, cells, hog.orientations))
    count = np.zeros((cells, cells, 1))
    for dx in range(hog.block):
        for dy in range(hog.block):
            place = np.s_[dy : dy + blocks, dx : dx + blocks]
            total[place] += values[:, :, dx, dy].transpose(1, 0, 2)
            count[place] += 1
    return np.asarray(total / count)


def _histogram_tile(counts: npt.NDArray[np.intp]) -> Image:
    """Draw `(3, bins)` counts as bars, one band for each channel, scaled to its highest bar."""
    bands = []
    for row in counts:
        band = np.full((TILE // 3, TILE, 3), 16, np.uint8)
        tops = np.round(row / max(1, row.max()) * (band.shape[0] - 4)).astype(int)
        edges = np.linspace(0, TILE, len(row) + 1).astype(int)
        for top, left, right in zip(tops, edges, edges[1:], strict=False):
            band[band.shape[0] - top :, left : max(left + 1, right - 1)] = 200
        bands.append(band)
    return np.vstack(bands)
