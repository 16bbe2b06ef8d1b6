"""Regions: the parts of the frames of one video in which vehicles are shown."""

from pathlib import Path

import cv2
import numpy as np

from vdet.boxes import BoolArray, Float64Array, visible
from vdet.config.places import RegionsSettings
from vdet.errors import ConfigError
from vdet.media.images import Image, read_header, read_image
from vdet.polygons import Outline, Point

_WHITE = 128
"""Least value of a pixel of a mask that is included."""


class SearchArea:
    """The pixels of a frame that may show the foot of a vehicle.

    Parameters
    ----------
    pixels
        bool `(H, W)`.
    """

    def __init__(self, pixels: BoolArray) -> None:
        self._size = pixels.shape[1], pixels.shape[0]
        self._sums = np.asarray(cv2.integral(pixels.astype(np.uint8)), np.int32)

    def touches(self, boxes: Float64Array) -> BoolArray:
        """Tell of each box `(n, 4)`, x1, y1, x2, y2 in whole pixels, whether a pixel lies in it."""
        left, top, right, bottom = visible(boxes, self._size).astype(np.int64).T
        sums = self._sums
        inside = sums[bottom, right] - sums[top, right] - sums[bottom, left] + sums[top, left]
        return np.asarray(inside > 0)


class Regions:
    """The regions, laid over frames of `width` × `height` pixels.

    Attributes
    ----------
    included, excluded
        Outlines of the polygons, by name.
    mask
        bool `(H, W)`: the mask in the size of the frames; None where there is none.

    Raises
    ------
    ConfigError
        They are given for frames of another aspect ratio.
    ImageError
        The mask cannot be read.
    """

    def __init__(self, settings: RegionsSettings, width: int, height: int) -> None:
        self._size = width, height
        try:
            across, down = settings.scales(width, height)
        except ConfigError as error:
            raise ConfigError(f"regions.{error}") from error
        self.included: dict[str, Outline] = {}
        self.excluded: dict[str, Outline] = {}
        for each in settings.polygons:
            outline = Outline.laid([(x * across, y * down) for x, y in each.points], self._size)
            named = self.included if each.kind == "include" else self.excluded
            named[each.name] = outline
        self.mask = _read_mask(settings.mask, width, height) if settings.mask else None

    def contains(self, point: Point) -> bool:
        """Tell whether a vehicle whose foot is at a point, x and y in pixels, is shown.

        A point outside the frame counts as at its edge.
        """
        if any(each.contains(point) for each in self.excluded.values()):
            return False
        if self.included and not any(each.contains(point) for each in self.included.values()):
            return False
        if self.mask is None:
            return True
        height, width = self.mask.shape
        x, y = min(max(int(point[0]), 0), width - 1), min(max(int(point[1]), 0), height - 1)
        return bool(self.mask[y, x])

    def name_at(self, point: Point) -> str | None:
        """Return the name of the first included polygon around a point; None in none of them."""
        return next((name for name, each in self.included.items() if each.contains(point)), None)

    def area(self) -> SearchArea:
        """Return all pixels that they contain."""
        return SearchArea(self.pixels())

    def pixels(self) -> BoolArray:
        """Return which pixels they contain, bool `(H, W)`; those on a border count as inside."""
        width, height = self._size
        pixels = np.full((height, width), not self.included)
        for each in self.included.values():
            pixels |= _filled(each, self._size)
        for each in self.excluded.values():
            pixels &= ~_eroded(_filled(each, self._size))
        return pixels if self.mask is None else pixels & self.mask


def lay_regions(settings: RegionsSettings, width: int, height: int) -> Regions | None:
    """Lay the regions of the settings over frames; None for the whole frame.

    Errors as of `Regions`.
    """
    return Regions(settings, width, height) if settings else None


def check_mask(settings: RegionsSettings) -> None:
    """Refuse a mask that cannot be read, before any work. Raises `ImageError`."""
    if settings.mask:
        read_header(Path(settings.mask))


def _read_mask(path: str, width: int, height: int) -> BoolArray:
    image = read_image(Path(path))
    rows, columns = image.shape[:2]
    try:
        RegionsSettings(size=(columns, rows)).scales(width, height)
    except ConfigError as error:
        raise ConfigError(
            f"{path}: the mask of {columns}×{rows} has another shape than the frames of "
            f"{width}×{height}; draw it over such a frame"
        ) from error
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    scaled = cv2.resize(grey, (width, height), interpolation=cv2.INTER_NEAREST)
    return np.asarray(scaled >= _WHITE)


def _filled(outline: Outline, size: tuple[int, int]) -> BoolArray:
    canvas = np.zeros((size[1], size[0]), np.uint8)
    corners = np.floor(np.array(outline.corners)).astype(np.int32)
    cv2.fillPoly(canvas, [corners], 1)  # with the pixels of its sides
    return canvas > 0


def _eroded(pixels: BoolArray) -> BoolArray:
    """Return the pixels without those at their border."""
    kernel = np.ones((3, 3), np.uint8)
    inner: Image = np.asarray(
        cv2.erode(pixels.astype(np.uint8), kernel, borderValue=1, borderType=cv2.BORDER_CONSTANT),
        np.uint8,
    )
    return inner > 0
