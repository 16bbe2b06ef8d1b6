"""A frame of a video: its pixels (BGR, or decoder planes), its time, and its video."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import Box, Float64Array, Image
from vdet.files import valid_text
from vdet.media.images import Orientation, from_16_bits, to_ycrcb

if TYPE_CHECKING:  # an image needs no PyAV
    import av
    from av.video.plane import VideoPlane

Layers = tuple[Image, Image, Image]
"""Luma, blue and red chroma, uint8 each; chroma may have half the size of luma."""

_LUMA_WEIGHTS = {"bt601": (0.299, 0.114), "bt709": (0.2126, 0.0722)}
"""Weights of red and blue in luma, ITU-R BT.601 and BT.709."""
_PLANAR = ("yuv420p", "yuvj420p")
_MATRICES: dict[int, Literal["bt601", "bt709"]] = {1: "bt709", 2: "bt601", 5: "bt601", 6: "bt601"}
"""By code of ITU-T H.273; untagged video is treated as BT.601."""
MATRIX_CODES = {"bt601": 6, "bt709": 1}
"""The codes to write."""

_16_BITS = ("gray16", "ya16", "rgb48", "rgba64")
"""Prefixes of pixel formats with 16 bits, as in PNG and TIFF."""

UNSPECIFIED = 2  # in each of the three code tables of ITU-T H.273


def _table(old_zero: float, new_zero: float, step: float) -> Image:
    """Return a lookup table that maps `old_zero` to `new_zero` and a step of 1 to `step`."""
    values = new_zero + (np.arange(256) - old_zero) * step
    return np.asarray(np.rint(values.clip(0, 255)), np.uint8)


_TO_FULL_RANGE = _table(16, 0, 255 / 219), _table(128, 128, 255 / 224)


_TO_LIMITED_RANGE = _table(0, 16, 219 / 255), _table(128, 128, 224 / 255)
"""Tables for luma and for chroma."""


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
        full = layers if self.full_range else _looked_up(layers, *_TO_FULL_RANGE)
        return full if self.matrix == "bt601" else _recoded(full, _FROM_BT709)

    def to_bgr(self, layers: Layers) -> Image:
        """Convert values of this coding to BGR, uint8 `(H, W, 3)`, in the size of luma."""
        luma, blue, red = self.to_common(layers)
        blue, red = _enlarged(blue, luma), _enlarged(red, luma)
        return np.asarray(cv2.cvtColor(cv2.merge([luma, red, blue]), cv2.COLOR_YCrCb2BGR), np.uint8)

    def from_common(self, layers: Layers) -> Layers:
        """Convert values of the common coding to this coding."""
        full = layers if self.matrix == "bt601" else _recoded(layers, _TO_BT709)
        return full if self.full_range else _looked_up(full, *_TO_LIMITED_RANGE)


def _looked_up(layers: Layers, luma_table: Image, chroma_table: Image) -> Layers:
    tables = luma_table, chroma_table, chroma_table
    luma, blue, red = (np.asarray(item, np.uint8) for item in map(cv2.LUT, layers, tables))
    return luma, blue, red


def _from_rgb(matrix: str) -> Float64Array:
    """Return the matrix from red, green, blue to luma, blue chroma, red chroma; 3 × 3."""
    red, blue = _LUMA_WEIGHTS[matrix]
    luma = np.array([red, 1 - red - blue, blue])
    blue_chroma = (np.array([0, 0, 1]) - luma) / (2 - 2 * blue)
    red_chroma = (np.array([1, 0, 0]) - luma) / (2 - 2 * red)
    return np.array([luma, blue_chroma, red_chroma])


_FROM_BT709 = _from_rgb("bt601") @ np.linalg.inv(_from_rgb("bt709"))


_TO_BT709 = np.linalg.inv(_FROM_BT709)


def _recoded(layers: Layers, matrix: Float64Array) -> Layers:
    """Convert full-range values to another matrix; luma changes only by a fraction of chroma."""
    luma, blue, red = layers

    def mixed(row: int, zero: int, depth: int) -> npt.NDArray[Any]:
        _, of_blue, of_red = matrix[row].tolist()
        offset = zero - 128 * (of_blue + of_red)
        return np.asarray(cv2.addWeighted(blue, of_blue, red, of_red, offset, dtype=depth))

    change = _enlarged(mixed(0, 0, cv2.CV_16S), luma)
    new_luma = np.asarray(cv2.add(luma, change, dtype=cv2.CV_8U), np.uint8)
    return new_luma, mixed(1, 128, cv2.CV_8U), mixed(2, 128, cv2.CV_8U)


def _enlarged(values: npt.NDArray[Any], luma: Image) -> npt.NDArray[Any]:
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
    layers
        Luma, blue and red.
    shape
        H and W.
    is_writable
        Whether nothing else uses the picture, so it may be changed and encoded.
    """

    def __init__(
        self, picture: "av.VideoFrame", coding: Coding, *, is_writable: bool = False
    ) -> None:
        self.picture = picture
        self.coding = coding
        self.is_writable = is_writable
        self.shape = picture.height, picture.width
        self.luma, self.blue, self.red = map(_values, picture.planes)
        self.layers: Layers = self.luma, self.blue, self.red

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
        half = width // 2, height // 2
        halves = [cv2.resize(values, half, interpolation=cv2.INTER_AREA) for values in chroma]
        return cls.blank(width, height, coding)._filled([luma, *halves])

    @classmethod
    def blank(cls, width: int, height: int, coding: Coding) -> "Planes":
        """Return new planes with undefined values; `width` × `height` pixels."""
        import av
        from av.video.reformatter import ColorRange

        picture = av.VideoFrame(width, height, "yuv420p")
        picture.colorspace = MATRIX_CODES[coding.matrix]
        picture.color_range = ColorRange.JPEG if coding.full_range else ColorRange.MPEG
        return cls(picture, coding, is_writable=True)

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


def _values(plane: "VideoPlane") -> Image:
    """Return the values of a plane, which share its memory; uint8 `(H, W)`."""
    values = np.frombuffer(cast(bytes, plane), np.uint8)  # it is not typed as such
    rows = values[: plane.line_size * plane.height].reshape(plane.height, plane.line_size)
    return rows[:, : plane.width]


class Picture:
    """An upright picture; it shares the memory of its pixels, which must not be changed.

    Parameters
    ----------
    pixels
        An image, BGR uint8 `(H, W, 3)`, or planes.

    Attributes
    ----------
    height, width
        Pixels.
    planes
        The planes, if the picture was made from planes.
    """

    def __init__(self, pixels: Image | Planes) -> None:
        self.pixels = pixels
        self.planes = pixels if isinstance(pixels, Planes) else None
        self.height: int = pixels.shape[0]
        self.width: int = pixels.shape[1]

    @property
    def layers(self) -> tuple[Image, ...]:
        """Luma, blue and red if it was made from planes, else the BGR image alone."""
        return self.planes.layers if self.planes else (self.image,)

    def to_bgr(self, layers: Sequence[Image]) -> Image:
        """Convert its `layers`, cut or scaled, to BGR uint8 `(h, w, 3)`."""
        if not self.planes:
            return layers[0]
        luma, blue, red = layers
        return self.planes.coding.to_bgr((luma, blue, red))

    def rows(self, rows: slice) -> tuple[Image, ...]:
        """Return the `layers` of some rows; planes are converted to the common coding."""
        if not self.planes:
            return (self.image[rows],)
        half = slice(rows.start // 2, -(-rows.stop // 2))
        luma, *chroma = self.planes.layers
        return self.planes.coding.to_common((luma[rows], chroma[0][half], chroma[1][half]))

    def scaled_luma(self, width: int, height: int) -> Image:
        """Return its luma in another size, full range, uint8 `(height, width)`."""
        luma = self.planes.luma if self.planes else cv2.cvtColor(self.image, cv2.COLOR_BGR2GRAY)
        scaled = cv2.resize(luma, (width, height), interpolation=cv2.INTER_AREA)
        if self.planes and not self.planes.coding.full_range:
            scaled = cv2.convertScaleAbs(scaled, alpha=255 / 219, beta=-16 * 255 / 219)
        return np.asarray(scaled, np.uint8)

    def mean_color(self, box: Float64Array) -> list[float]:
        """Return the mean luma, blue and red chroma in a box, x1, y1, x2, y2; as in the planes."""
        if self.planes:
            parts = zip(self.planes.layers, (1, 2, 2), strict=True)
            return [cv2.mean(_part(layer, box / scale))[0] for layer, scale in parts]
        blue, green, red, _ = cv2.mean(_part(self.image, box))
        luma = 0.114 * blue + 0.587 * green + 0.299 * red  # ITU-R BT.601
        return [luma, 128 + 0.564 * (blue - luma), 128 + 0.713 * (red - luma)]

    def to_encode(self, coding: Coding) -> "av.VideoFrame":
        """Return it in a coding, with even sides, as a picture that the encoder may change."""
        planes = self.planes
        if planes is None or planes.coding != coding or self.width % 2 or self.height % 2:
            planes = Planes.of_image(self.image, coding)
        return (planes if planes.is_writable else planes.copy()).picture

    def copy(self, used: Planes | None = None) -> Image | Planes:
        """Return a copy of the pixels that may be changed: see `Planes.copy`."""
        return self.planes.copy(used) if self.planes else self.image.copy()

    def deferred_crop(self, box: Box) -> Callable[[], Image]:
        """Copy the part in a box. Return a function that converts it to BGR uint8 `(H, W, 3)`."""
        if not self.planes:
            part = box.cut(self.image).copy()
            return lambda: part
        x1, y1, x2, y2 = (max(0, side) for side in box.pixels)
        x, y, coding = x1 // 2, y1 // 2, self.planes.coding  # chroma values stand for 2 × 2 pixels
        luma = self.planes.luma[2 * y : y2, 2 * x : x2].copy()
        blue, red = (
            layer[y : (y2 + 1) // 2, x : (x2 + 1) // 2].copy()
            for layer in (self.planes.blue, self.planes.red)
        )
        return lambda: coding.to_bgr((luma, blue, red))[y1 % 2 :, x1 % 2 :]

    @cached_property
    def image(self) -> Image:
        """BGR uint8 `(H, W, 3)`; converted from planes on first use."""
        return self.pixels.to_image() if isinstance(self.pixels, Planes) else self.pixels


def _part(image: Image, box: Float64Array) -> Image:
    """Return the pixels in a box, at least one."""
    x1, y1, x2, y2 = box.tolist()
    x, y = min(int(x1), image.shape[1] - 1), min(int(y1), image.shape[0] - 1)
    return image[y : max(round(y2), y + 1), x : max(round(x2), x + 1)]


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


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One frame of a video.

    `index` counts all frames of the file from 0. `time` is the exact presentation time, seconds
    from the first frame of the file.
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
    """Metadata of the recording in the file; None if missing.

    `exporter` is the program that wrote the file again, so that the creation time may be its own.
    """

    creation_time: str | None = None
    location: str | None = None
    title: str | None = None
    exporter: str | None = None


@dataclass(frozen=True, slots=True)
class VideoInfo:
    """Properties of a video that are known before its frames are read.

    `width` and `height` are of the upright picture in pixels. `rate` is the average in frames per
    second (25 where the file gives none), `time_base` the unit of the file's times in seconds,
    `start` the time of the first frame in the file. `frames` and `duration` (seconds) are what it
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
    has_audio: bool = False
    tags: Tags = Tags()

    @property
    def name(self) -> str:
        """The name of the file, as outputs have it."""
        return valid_text(self.path.name)
