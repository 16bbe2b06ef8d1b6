"""A frame of a video: its pixels (BGR, or decoder planes), its time, and its video."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import Float64Array, Image
from vdet.media.images import Orientation, from_16_bits, to_ycrcb

if TYPE_CHECKING:  # an image needs no PyAV
    import av

Layers = tuple[Image, Image, Image]
"""Luma, blue and red chroma, uint8 each; chroma may have half the size of luma."""

LUMA_WEIGHTS = {"bt601": (0.299, 0.114), "bt709": (0.2126, 0.0722)}
"""Weights of red and blue in luma, ITU-R BT.601 and BT.709."""

_PLANAR = ("yuv420p", "yuvj420p")
_MATRICES: dict[int, Literal["bt601", "bt709"]] = {1: "bt709", 2: "bt601", 5: "bt601", 6: "bt601"}
"""By code of ITU-T H.273; untagged video is treated as BT.601."""
MATRIX_CODES = {"bt601": 6, "bt709": 1}
"""The codes to write."""

_LUMA_STEPS, _CHROMA_STEPS = 219 / 255, 224 / 255  # limited-range steps per full-range step


def _table(new_base: float, base: float, steps: float) -> Image:
    """Return a lookup table that maps `base` to `new_base` and a step of 1 to `steps`."""
    values = new_base + (np.arange(256) - base) * steps
    return np.asarray(np.rint(values.clip(0, 255)), np.uint8)


_FULL_LUMA, _FULL_CHROMA = _table(0, 16, 1 / _LUMA_STEPS), _table(128, 128, 1 / _CHROMA_STEPS)
_LIMITED_LUMA, _LIMITED_CHROMA = _table(16, 0, _LUMA_STEPS), _table(128, 128, _CHROMA_STEPS)


@dataclass(frozen=True, slots=True)
class Coding:
    """A coding of colours: its matrix, and whether luma uses 0 to 255 or 16 to 235.

    The common coding is BT.601 with full range, as in OpenCV's YCrCb.
    """

    matrix: Literal["bt601", "bt709"] = "bt601"
    full_range: bool = False

    @classmethod
    def of(cls, picture: "av.VideoFrame") -> "Coding | None":
        """Return the coding of a decoded 4:2:0 picture; None for other pixel formats."""
        matrix = _MATRICES.get(picture.colorspace)
        is_flipped = any(plane.line_size < 0 for plane in picture.planes)  # rows from bottom to top
        if picture.format.name not in _PLANAR or matrix is None or is_flipped:
            return None
        from av.video.reformatter import ColorRange

        full_range = picture.color_range == ColorRange.JPEG or picture.format.name == "yuvj420p"
        return cls(matrix, full_range)

    def to_common(self, layers: Layers) -> Layers:
        """Convert values of this coding to the common coding."""
        stretched = layers if self.full_range else _looked_up(layers, _FULL_LUMA, _FULL_CHROMA)
        return stretched if self.matrix == "bt601" else _recoded(stretched, _FROM_BT709)

    def to_bgr(self, layers: Layers) -> Image:
        """Convert values of this coding to BGR, uint8 `(H, W, 3)`, in the size of luma."""
        luma, *chroma = self.to_common(layers)
        blue, red = (_as_large(item, luma) for item in chroma)
        return np.asarray(cv2.cvtColor(cv2.merge([luma, red, blue]), cv2.COLOR_YCrCb2BGR), np.uint8)

    def from_common(self, layers: Layers) -> Layers:
        """Convert values of the common coding to this coding."""
        recoded = layers if self.matrix == "bt601" else _recoded(layers, _TO_BT709)
        return recoded if self.full_range else _looked_up(recoded, _LIMITED_LUMA, _LIMITED_CHROMA)


def _looked_up(layers: Layers, for_luma: Image, for_chroma: Image) -> Layers:
    pairs = zip(layers, (for_luma, for_chroma, for_chroma), strict=True)
    luma, blue, red = (np.asarray(cv2.LUT(*pair), np.uint8) for pair in pairs)
    return luma, blue, red


def _from_rgb(matrix: str) -> Float64Array:
    """Return the matrix from red, green, blue to luma, blue chroma, red chroma; 3 × 3."""
    red, blue = LUMA_WEIGHTS[matrix]
    luma = np.array([red, 1 - red - blue, blue])
    blue_chroma = (np.array([0, 0, 1]) - luma) / (2 - 2 * blue)
    red_chroma = (np.array([1, 0, 0]) - luma) / (2 - 2 * red)
    return np.array([luma, blue_chroma, red_chroma])


_FROM_BT709 = _from_rgb("bt601") @ np.linalg.inv(_from_rgb("bt709"))
_TO_BT709 = np.linalg.inv(_FROM_BT709)
_KINDS = cv2.CV_16S, cv2.CV_8U, cv2.CV_8U  # of a change of luma, of blue and red chroma


def _recoded(layers: Layers, matrix: Float64Array) -> Layers:
    """Convert full-range values to another matrix; luma changes only by a fraction of chroma."""
    luma, first, second = layers
    mixed: list[Any] = []
    for (_, a, b), zero, kind in zip(matrix.tolist(), (0, 128, 128), _KINDS, strict=True):
        offset = zero - 128 * (a + b)
        mixed.append(np.asarray(cv2.addWeighted(first, a, second, b, offset, dtype=kind)))
    change, blue, red = mixed
    return np.asarray(cv2.add(luma, _as_large(change, luma), dtype=cv2.CV_8U), np.uint8), blue, red


def _as_large(values: npt.NDArray[Any], luma: Image) -> npt.NDArray[Any]:
    """Scale chroma to the size of luma; at half size, a value stands for 2 × 2 pixels."""
    if values.shape == luma.shape:
        return values
    height, width = luma.shape
    return values.repeat(2, axis=0).repeat(2, axis=1)[:height, :width]


class Planes:
    """A picture of H × W pixels as planes that share the memory of `picture`.

    Attributes
    ----------
    luma
        uint8 `(H, W)`.
    blue, red
        Chroma, uint8 `(⌈H / 2⌉, ⌈W / 2⌉)`; a value stands for 2 × 2 pixels.
    is_own
        Whether nothing else uses the picture, so it may be changed and encoded.
    """

    def __init__(self, picture: "av.VideoFrame", coding: Coding, *, is_own: bool = False) -> None:
        self.picture = picture
        self.coding = coding
        self.is_own = is_own
        self.luma, self.blue, self.red = (_plane(picture, number) for number in range(3))

    @classmethod
    def of_image(cls, image: Image, coding: Coding) -> "Planes":
        """Convert an image, BGR uint8 `(H, W, 3)`.

        4:2:0 needs even sides: the last row or column of an odd one is repeated.
        """
        height, width = image.shape[:2]
        if height % 2 or width % 2:
            edge = cv2.BORDER_REPLICATE
            image = cv2.copyMakeBorder(image, 0, height % 2, 0, width % 2, edge).astype(np.uint8)
            height, width = image.shape[:2]
        luma, red, blue = to_ycrcb(image)
        luma, *chroma = coding.from_common((luma, blue, red))
        half, area = (width // 2, height // 2), cv2.INTER_AREA
        halves = (cv2.resize(item, half, interpolation=area) for item in chroma)
        return cls.blank(width, height, coding)._filled((luma, *halves))

    @classmethod
    def blank(cls, width: int, height: int, coding: Coding) -> "Planes":
        """Return new planes with undefined values; `width` × `height` pixels."""
        import av
        from av.video.reformatter import ColorRange

        picture = av.VideoFrame(width, height, "yuv420p")
        picture.colorspace = MATRIX_CODES[coding.matrix]
        picture.color_range = ColorRange.JPEG if coding.full_range else ColorRange.MPEG
        return cls(picture, coding, is_own=True)

    def _filled(self, layers: Iterable[cv2.typing.MatLike]) -> "Planes":
        for target, source in zip(self.layers, layers, strict=True):
            target[:] = source
        return self

    def copy(self, used: "Planes | None" = None) -> "Planes":
        """Return a copy that may be changed; it reuses the memory of `used`, of the same size."""
        height, width = self.shape
        return (used or self.blank(width, height, self.coding))._filled(self.layers)

    def to_image(self) -> Image:
        """Return the picture as BGR uint8 `(H, W, 3)`; a chroma value applies to 2 × 2 pixels.

        The error is 1 to 4 levels, more for colours outside BGR.
        """
        height, width = self.shape
        if self.coding == Coding() and not (height % 2 or width % 2):  # OpenCV is faster
            stacked = np.concatenate([layer.ravel() for layer in self.layers]).reshape(-1, width)
            return np.asarray(cv2.cvtColor(stacked, cv2.COLOR_YUV2BGR_I420), np.uint8)
        return self.coding.to_bgr(self.layers)

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width, pixels."""
        return self.picture.height, self.picture.width

    @property
    def layers(self) -> Layers:
        """Luma, blue and red."""
        return self.luma, self.blue, self.red


def _plane(picture: "av.VideoFrame", number: int) -> Image:
    plane = picture.planes[number]
    values = np.frombuffer(cast(bytes, plane), np.uint8)  # it is not typed as such
    rows = values[: plane.line_size * plane.height].reshape(plane.height, plane.line_size)
    return rows[:, : plane.width]


class Picture:
    """An upright picture; it shares the memory of its pixels, which must not be changed.

    Parameters
    ----------
    pixels
        An image, BGR uint8 `(H, W, 3)`, or planes.
    """

    def __init__(self, pixels: Image | Planes) -> None:
        self.pixels = pixels

    @property
    def height(self) -> int:
        """Pixels."""
        return int(self.pixels.shape[0])

    @property
    def width(self) -> int:
        """Pixels."""
        return int(self.pixels.shape[1])

    @property
    def planes(self) -> Planes | None:
        """The planes, if the picture was made from planes."""
        return self.pixels if isinstance(self.pixels, Planes) else None

    def copy(self, used: Planes | None = None) -> Image | Planes:
        """Return a copy of the pixels that may be changed: see `Planes.copy`."""
        return self.pixels.copy(used) if isinstance(self.pixels, Planes) else self.pixels.copy()

    @cached_property
    def image(self) -> Image:
        """BGR uint8 `(H, W, 3)`; converted from planes on first use."""
        return self.pixels.to_image() if isinstance(self.pixels, Planes) else self.pixels


_16_BITS = ("gray16", "ya16", "rgb48", "rgba64")
"""Prefixes of pixel formats with 16 bits, as in PNG and TIFF."""


def bgr_of(picture: "av.VideoFrame") -> Image:
    """Return a decoded picture as BGR uint8 `(H, W, 3)`.

    Colour matrix and range are taken from its tags; without tags, BT.601 and limited. For 16-bit
    values see `from_16_bits`.
    """
    if coding := Coding.of(picture):
        return Planes(picture, coding).to_image()
    if picture.format.name.startswith(_16_BITS):
        return from_16_bits(picture.to_ndarray(format="bgr48le", threads=1).astype(np.uint16))
    image = np.asarray(picture.to_ndarray(format="bgr24", threads=1), np.uint8)
    return image.copy() if picture.format.name == "bgr24" else np.ascontiguousarray(image)


UNSPECIFIED = 2  # in each of the three code tables of ITU-T H.273


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One frame of a video.

    `index` counts all frames of the file from 0. `time` is the exact presentation time in the file,
    seconds (the first frame need not be at 0).
    """

    index: int
    time: Fraction
    picture: Picture

    @property
    def image(self) -> Image:
        """The picture as BGR uint8 `(H, W, 3)`."""
        return self.picture.image


@dataclass(frozen=True, slots=True)
class ColorTags:
    """How the colours of a video are coded, in codes of ITU-T H.273."""

    primaries: int = UNSPECIFIED
    transfer: int = UNSPECIFIED
    matrix: int = UNSPECIFIED


@dataclass(frozen=True, slots=True)
class Tags:
    """Metadata of the recording in the file; None if missing."""

    creation_time: str | None = None
    location: str | None = None
    title: str | None = None


@dataclass(frozen=True, slots=True)
class VideoInfo:
    """Properties of a video that are known before its frames are read.

    `width` and `height` are of the upright picture in pixels. `rate` is the average in frames per
    second (25 where the file gives none), `time_base` the unit of the file's times in seconds,
    `start` the time of the first frame. `frames` and `duration` (seconds) are what the file
    declares, or an estimate: not exact, None where unknown. `orientation` says how the coded
    picture was turned to stand upright. `pixel_aspect` is the width of an upright pixel over its
    height. `color` is of the images: where the file is HDR (PQ or HLG), they are BT.709.
    `coding` is that of frames that consist of planes, and of a video that is written from them.
    """

    path: Path
    width: int
    height: int
    rate: Fraction
    time_base: Fraction
    start: Fraction = Fraction(0)
    frames: int | None = None
    duration: Fraction | None = None
    orientation: Orientation = field(default_factory=Orientation)
    pixel_aspect: Fraction = Fraction(1)
    color: ColorTags = ColorTags()
    coding: Coding = field(default_factory=Coding)
    has_sound: bool = False
    tags: Tags = Tags()
