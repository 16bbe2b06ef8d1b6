"""Regions: the parts of the frames of one video in which vehicles are shown."""

from pathlib import Path

import cv2
import numpy as np

from vdet.boxes import BoolArray
from vdet.config.places import RegionsSettings
from vdet.errors import ConfigError
from vdet.media.images import read_header, read_image
from vdet.polygons import Point

_WHITE = 128
"""Least value of a pixel of a mask that is included."""


class Regions:
    """The regions of the settings, in pixels of frames of `width` × `height`.

    Attributes
    ----------
    included, excluded
        The corners of the polygons, pixels, by name.
    pixels
        bool `(H, W)`: the pixels in which a vehicle may stand. Excluded polygons, like included
        ones, have the pixels of their sides.

    Raises
    ------
    ConfigError
        They are given for frames of another aspect ratio.
    ImageError
        The mask cannot be read.
    """

    def __init__(self, settings: RegionsSettings, width: int, height: int) -> None:
        across, down = settings.scales(width, height)
        self.included: dict[str, list[Point]] = {}
        self.excluded: dict[str, list[Point]] = {}
        for each in settings.polygons:
            named = self.included if each.kind == "include" else self.excluded
            named[each.name] = [(x * across, y * down) for x, y in each.points]
        shown = np.full((height, width), not self.included, np.uint8)
        for polygons, value in ((self.included, 1), (self.excluded, 0)):
            for corners in polygons.values():  # with the pixels of their sides
                cv2.fillPoly(shown, [np.floor(corners).astype(np.int32)], value)
        self.pixels: BoolArray = shown > 0
        if settings.mask:
            self.pixels &= _read_mask(settings.mask, width, height)

    def contains(self, point: Point) -> bool:
        """Return whether a vehicle whose foot is at a point, x and y in pixels, is shown.

        A point outside the frame counts as at its edge.
        """
        height, width = self.pixels.shape
        x, y = min(max(int(point[0]), 0), width - 1), min(max(int(point[1]), 0), height - 1)
        return bool(self.pixels[y, x])


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
            f"{path}: has another shape than the frames of {width}×{height}; draw it over one"
        ) from error
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    return np.asarray(cv2.resize(grey, (width, height), interpolation=cv2.INTER_NEAREST) >= _WHITE)
