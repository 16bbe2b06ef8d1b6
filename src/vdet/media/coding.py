"""Colour coding of pictures: BT.601 or BT.709, full or limited range, high dynamic range.

References for high dynamic range: ITU-R BT.2100 (transfer functions), BT.2408 (reference white),
BT.2087 (primaries).
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import Float64Array, Image

if TYPE_CHECKING:
    import av

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
    def of(cls, picture: "av.VideoFrame") -> "Coding | None":
        """Return the coding of a decoded 4:2:0 picture; None for other pixel formats."""
        from av.video.reformatter import ColorRange

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
        blue, red = (_as_large(each, luma) for each in chroma)
        return np.asarray(cv2.cvtColor(cv2.merge([luma, red, blue]), cv2.COLOR_YCrCb2BGR), np.uint8)

    def from_common(self, layers: Layers) -> Layers:
        """Convert values of the common coding to this coding."""
        recoded = layers if self.matrix == "bt601" else _recoded(layers, _TO_BT709)
        return recoded if self.full_range else _looked_up(recoded, _LIMITED_LUMA, _LIMITED_CHROMA)


def _looked_up(layers: Layers, for_luma: Image, for_chroma: Image) -> Layers:
    tables = for_luma, for_chroma, for_chroma
    luma, blue, red = (
        np.asarray(cv2.LUT(*each), np.uint8) for each in zip(layers, tables, strict=True)
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
    """Convert full-range values to another matrix; luma changes only by a share of chroma."""
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


HDR_TRANSFERS = {16: "PQ", 18: "HLG"}
"""Transfer codes of ITU-T H.273, and their names."""

_WHITE = 203.0  # cd/m²; reference white, which becomes white
_PEAK = 1000.0 / _WHITE  # brighter light is clipped
_KNEE = 0.7  # light above it is compressed
_STEPS = 65_536
_GAMMA = 2.4  # of a display for BT.709, ITU-R BT.1886
_BT2020_TO_BT709 = np.array(
    [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]]
)


class StandardRange:
    """Converts frames of HDR video to standard range; `transfer` is a key of `HDR_TRANSFERS`."""

    def __init__(self, transfer: int) -> None:
        signal = np.linspace(0, 1, 256)
        light = _pq_light(signal) if HDR_TRANSFERS[transfer] == "PQ" else _hlg_light(signal)
        self._light = np.asarray(light / _WHITE / _PEAK, np.float32)
        shown = _compressed(np.linspace(0, _PEAK, _STEPS)) ** (1 / _GAMMA)
        self._coded = np.rint(shown * 255).astype(np.uint8)
        self._primaries = np.asarray(_BT2020_TO_BT709[::-1, ::-1] * (_STEPS - 1), np.float32)

    def convert(self, image: Image) -> Image:
        """Convert a BT.2020 frame to BT.709; BGR uint8 `(H, W, 3)`."""
        light = cv2.LUT(image, self._light)
        steps = cv2.transform(light, self._primaries)
        return self._coded[np.clip(steps, 0, _STEPS - 1).astype(np.uint16)]


def _pq_light(signal: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return the light in cd/m² of PQ signals, 0 to 1 (BT.2100, table 4)."""
    m1, m2 = 2610 / 16_384, 2523 / 4096 * 128
    c1, c2, c3 = 3424 / 4096, 2413 / 4096 * 32, 2392 / 4096 * 32
    root = signal ** (1 / m2)
    light: npt.NDArray[np.float64] = (np.maximum(root - c1, 0) / (c2 - c3 * root)) ** (1 / m1)
    return 10_000 * light


def _hlg_light(signal: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return the light in cd/m² of HLG signals, 0 to 1, on a display of 1000 cd/m².

    The system gamma is applied to each channel, not to the luminance as in BT.2100, table 5.
    """
    a, b, c = 0.17883277, 0.28466892, 0.55991073
    scene = np.where(signal <= 0.5, signal**2 / 3, (np.exp((signal - c) / a) + b) / 12)
    light: npt.NDArray[np.float64] = 1000 * scene**1.2
    return light


def _compressed(light: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Map 0 to `_PEAK` to 0 to 1: identity up to `_KNEE`, then a Möbius curve, smooth at it."""
    above = np.maximum(light - _KNEE, 0) / (_PEAK - _KNEE)
    bend = 1 / ((_PEAK - _KNEE) / (1 - _KNEE) - 1)
    return np.where(
        light <= _KNEE, light, _KNEE + (1 - _KNEE) * above * (1 + bend) / (above + bend)
    )
