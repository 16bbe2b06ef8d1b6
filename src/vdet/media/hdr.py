"""High dynamic range to standard range: frames of BT.2100 video (PQ or HLG) as BT.709 shows them.

References: ITU-R BT.2100 (transfer functions), BT.2408 (reference white), BT.2087 (primaries).
"""

import cv2
import numpy as np
import numpy.typing as npt

from vdet.media.images import Image

HDR_TRANSFERS = {16: "PQ", 18: "HLG"}
"""Transfer codes of ITU-T H.273, and their names."""

_WHITE = 203.0  # cd/m²; reference white, which becomes white
_PEAK = 1000.0 / _WHITE  # what is brighter is cut
_KNEE = 0.7  # darker light is kept as it is, brighter light is compressed
_STEPS = 65_536
_GAMMA = 2.4  # of a display for BT.709, ITU-R BT.1886
_BT2020_TO_BT709 = np.array(
    [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]]
)

_Table = npt.NDArray[np.float32]


class StandardRange:
    """Converts frames of HDR video; `transfer` is a key of `HDR_TRANSFERS`."""

    def __init__(self, transfer: int) -> None:
        signal = np.linspace(0, 1, 256)
        light = _pq_light(signal) if HDR_TRANSFERS[transfer] == "PQ" else _hlg_light(signal)
        self._light = np.asarray(light / _WHITE / _PEAK, np.float32)
        shown = _compressed(np.linspace(0, _PEAK, _STEPS)) ** (1 / _GAMMA)
        self._coded = np.rint(shown * 255).astype(np.uint8)
        self._primaries = np.asarray(_BT2020_TO_BT709[::-1, ::-1] * (_STEPS - 1), np.float32)

    def convert(self, image: Image) -> Image:
        """Return a frame as BGR uint8 of BT.709, shape `(H, W, 3)`; it is BT.2020 before."""
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
