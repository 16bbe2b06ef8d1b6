"""A frame at full, half, quarter … size, from which strips and windows are cut."""

import cv2
import numpy as np

from vdet.boxes import Image
from vdet.config.detector import FeatureSettings
from vdet.detect.svm.features import Channels, halve, resize, split
from vdet.detect.svm.windows import Strip
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

    def cut(self, strip: Strip) -> Channels:
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
    planes = picture.planes
    if planes is None:
        return [_Levels(_widened(picture.image[rows], margin))]
    blue_red = slice(rows.start // 2, -(-rows.stop // 2))
    luma, blue, red = planes.coding.to_common(
        (planes.luma[rows], planes.blue[blue_red], planes.red[blue_red])
    )
    chroma = [_Levels(_widened(item, margin // 2), level=1) for item in (red, blue)]
    return [_Levels(_widened(luma, margin)), *chroma]


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
