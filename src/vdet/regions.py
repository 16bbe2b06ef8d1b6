"""Regions: the parts of the frames of one video in which vehicles are shown."""

import logging
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from vdet.boxes import BoolArray, Image
from vdet.config.scene import RegionSettings, aspect_problem
from vdet.errors import ConfigError
from vdet.media.images import read_image
from vdet.polygons import Point

log = logging.getLogger("vdet")

_WHITE = 128
"""Minimum value of a pixel of a mask that is included."""


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
        The points of a polygon, or a mask, have another aspect ratio, a mask has no white, or the
        regions leave no pixel.
    ImageError
        A mask cannot be read.
    """

    def __init__(self, settings: Sequence[RegionSettings], width: int, height: int) -> None:
        self.included: dict[str, list[Point]] = {}
        self.excluded: dict[str, list[Point]] = {}
        polygons = {"include": self.included, "exclude": self.excluded}
        layers = {kind: np.zeros((height, width), np.uint8) for kind in polygons}
        for setting in settings:
            layer = layers[setting.kind]
            if setting.mask:
                layer |= _read_mask(setting.mask, width, height)
            else:
                corners = list(setting.for_frames(width, height).points or ())
                polygons[setting.kind][setting.name] = corners
                cv2.fillPoly(layer, [np.floor(corners).astype(np.int32)], 1)
        shows_all = not any(setting.kind == "include" for setting in settings)
        self.pixels: BoolArray = (shows_all | (layers["include"] > 0)) & (layers["exclude"] == 0)
        if not self.pixels.any():
            names = ", ".join(setting.name for setting in settings)
            raise ConfigError(f"regions ({names}): nothing of the frame is left; change one")

    def contains(self, point: Point) -> bool:
        """Return whether a vehicle that stands at a point, x and y in pixels, is shown.

        A point outside the frame counts as at its edge.
        """
        height, width = self.pixels.shape
        x, y = min(max(int(point[0]), 0), width - 1), min(max(int(point[1]), 0), height - 1)
        return bool(self.pixels[y, x])


def check_masks(settings: Sequence[RegionSettings]) -> None:
    """Check that all masks can be read and have white. Raises `ImageError`, `ConfigError`.

    There is a warning (logger "vdet") if one covers the whole frame.
    """
    for setting in settings:
        if setting.mask and _read_grey(setting.mask).min() >= _WHITE:
            log.warning("%s: covers the whole frame; draw what is outside in black", setting.mask)


def _read_grey(path: str) -> Image:
    """Return the grey values of a mask, uint8 `(H, W)`; what is transparent is black."""
    image = read_image(Path(path), on_black=True)
    grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
    if (brightest := int(grey.max())) < _WHITE:
        raise ConfigError(
            f"{path}: has no white: its brightest pixel is {brightest} of 255; "
            f"draw the region with {_WHITE} or more"
        )
    return grey


def _read_mask(path: str, width: int, height: int) -> BoolArray:
    grey = _read_grey(path)
    rows, columns = grey.shape
    if aspect_problem((columns, rows), width, height):
        raise ConfigError(
            f"{path}: its aspect ratio differs from frames of {width}×{height}; draw it on a frame"
        )
    return np.asarray(cv2.resize(grey, (width, height), interpolation=cv2.INTER_NEAREST) >= _WHITE)
