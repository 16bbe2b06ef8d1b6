"""Colour coding of pictures: BT.601 or BT.709, full or limited range."""

from dataclasses import dataclass
from typing import Any, Literal

import av
import cv2
import numpy as np
import numpy.typing as npt
from av.video.reformatter import ColorRange

from vdet.boxes import Float64Array, Image

Layers = tuple[Image, Image, Image]
"""Luma, blue and red chroma, uint8 each; chroma may be of half the size of luma."""

LUMA_SHARES = {"bt601": (0.299, 0.114), "bt709": (0.2126, 0.0722)}
"""Shares of red and blue in luma, ITU-R BT.601 and BT.709."""

_PLANAR = ("yuv420p", "yuvj420p")
_MATRICES: dict[int, Literal["bt601", "bt709"]] = {1: "bt709", 2: "bt601", 5: "bt601", 6: "bt601"}
"""By code of ITU-T H.273; untagged video is taken for BT.601."""

_LUMA_STEPS, _CHROMA_STEPS = 219 / 255, 224 / 255  # of the limited range, for one of the full range


def _table(new_base: float, base: float, steps: float) -> Image:
    """Return a lookup table that maps `base` to `new_base` and a step of 1 to `steps`."""
    values = new_base + (np.arange(256) - base) * steps
    return np.asarray(np.rint(values.clip(0, 255)), np.uint8)


_FULL_LUMA, _FULL_CHROMA = _table(0, 16, 1 / _LUMA_STEPS), _table(128, 128, 1 / _CHROMA_STEPS)
_LIMITED_LUMA, _LIMITED_CHROMA = _table(16, 0, _LUMA_STEPS), _table(128, 128, _CHROMA_STEPS)


@dataclass(frozen=True, slots=True)
class Coding:
    """A coding of colours: its matrix, and whether luma uses 0 to 255 or 16 to 235.

    The common coding of all pictures is BT.601 with the full range, as in OpenCV's YCrCb.
    """

    matrix: Literal["bt601", "bt709"] = "bt601"
    full_range: bool = False

    @classmethod
    def of(cls, picture: av.VideoFrame) -> "Coding | None":
        """Return the coding of a decoded 4:2:0 picture; None for other pixel formats."""
        matrix = _MATRICES.get(picture.colorspace)
        is_flipped = any(plane.line_size < 0 for plane in picture.planes)  # rows from below
        if picture.format.name not in _PLANAR or matrix is None or is_flipped:
            return None
        full_range = picture.color_range == ColorRange.JPEG or picture.format.name == "yuvj420p"
        return cls(matrix, full_range)

    def to_common(self, layers: Layers) -> Layers:
        """Convert values of this coding to the common coding."""
        stretched = layers if self.full_range else _looked_up(layers, _FULL_LUMA, _FULL_CHROMA)
        return stretched if self.matrix == "bt601" else _recoded(stretched, _FROM_BT709)

    def to_bgr(self, layers: Layers) -> Image:
        """Convert values of this coding to BGR, uint8 `(H, W, 3)`, of the size of luma."""
        luma, *chroma = self.to_common(layers)
        blue, red = (_as_large(item, luma) for item in chroma)
        return np.asarray(cv2.cvtColor(cv2.merge([luma, red, blue]), cv2.COLOR_YCrCb2BGR), np.uint8)

    def from_common(self, layers: Layers) -> Layers:
        """Convert values of the common coding to this coding."""
        recoded = layers if self.matrix == "bt601" else _recoded(layers, _TO_BT709)
        return recoded if self.full_range else _looked_up(recoded, _LIMITED_LUMA, _LIMITED_CHROMA)


def _looked_up(layers: Layers, for_luma: Image, for_chroma: Image) -> Layers:
    tables = for_luma, for_chroma, for_chroma
    luma, blue, red = (
        np.asarray(cv2.LUT(*item), np.uint8) for item in zip(layers, tables, strict=True)
    )
    return luma, blue, red


def _from_rgb(matrix: str) -> Float64Array:
    """Return the matrix from red, green, blue to luma, blue chroma, red chroma; 3 × 3."""
    red, blue = LUMA_SHARES[matrix]
    luma = np.array([red, 1 - red - blue, blue])
    blue_chroma = (np.array([0, 0, 1]) - luma) / (2 - 2 * blue)
    red_chroma = (np.array([1, 0, 0]) - luma) / (2 - 2 * red)
    return np.array([luma, blue_chroma, red_chroma])


_FROM_BT709 = _from_rgb("bt601") @ np.linalg.inv(_from_rgb("bt709"))
_TO_BT709 = np.linalg.inv(_FROM_BT709)


def _recoded(layers: Layers, matrix: Float64Array) -> Layers:
    """Convert full-range values to another matrix; luma changes only by a fraction of chroma."""
    luma, *chroma = layers
    (_, *added), *mixed = matrix.tolist()
    change = _mixture(chroma, added, -128 * sum(added), cv2.CV_16S)
    blue, red = (
        np.asarray(_mixture(chroma, shares, 128 * (1 - sum(shares)), cv2.CV_8U), np.uint8)
        for _, *shares in mixed
    )
    return np.asarray(cv2.add(luma, _as_large(change, luma), dtype=cv2.CV_8U), np.uint8), blue, red


def _mixture(
    chroma: list[Image], shares: list[float], offset: float, kind: int
) -> cv2.typing.MatLike:
    return cv2.addWeighted(chroma[0], shares[0], chroma[1], shares[1], offset, dtype=kind)


def _as_large(values: npt.NDArray[Any], luma: Image) -> npt.NDArray[Any]:
    """Scale chroma to the size of luma; at half size, a value stands for 2 × 2 pixels."""
    if values.shape == luma.shape:
        return values
    height, width = luma.shape
    return values.repeat(2, axis=0).repeat(2, axis=1)[:height, :width]
