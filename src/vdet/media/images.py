"""Images: reading upright as BGR uint8, encoding, and numbered images, which are a video."""

import io
import logging
import math
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image as pillow  # noqa: N813
from PIL.ImageFile import ImageFile

from vdet.boxes import Image
from vdet.errors import ImageError, VideoError
from vdet.files import read_whole

if TYPE_CHECKING:
    import av

MAX_IMAGE_PIXELS = 2**25
"""Maximum number of pixels: an 8K frame has fewer, a decompression bomb far more."""
MAX_IMAGE_SIDE = 2**15
MAX_BYTES = 256_000_000
"""Maximum size of an image file: enough for `MAX_IMAGE_PIXELS` of 16 bits, uncompressed."""
IMAGE_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp"})

_FORMATS = ("PNG", "JPEG", "BMP", "TIFF", "WEBP")
_NO_IMAGE = "is not an image, or is damaged (PNG, JPEG, BMP, TIFF, WebP)"
_TOO_LARGE = (
    f"has more than {MAX_IMAGE_PIXELS:,} pixels, or a side of more than {MAX_IMAGE_SIDE:,}; "
    "make it smaller"
)
_12_BITS, _16_BITS = 4095, 65_535
"""The values of white."""
_ALL_BITS = cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
_COARSE_SIDE = 40
"""Pixels across a vehicle at which no face or plate is readable."""
_JPEG_SCAN, _JPEG_END = b"\xff\xda", b"\xff\xd9"  # markers, ITU-T T.81, annex B
_ORIENTATION = 274  # EXIF tag

log = logging.getLogger("vdet")

_TURNS = {90: cv2.ROTATE_90_COUNTERCLOCKWISE, 180: cv2.ROTATE_180, 270: cv2.ROTATE_90_CLOCKWISE}

_PATTERN = re.compile(r"([^%]*)%(?:0([1-9]\d*))?d([^%]*)", re.ASCII)
_NUMBERED = re.compile(r".*?(\d+)\D*\.\w+", re.ASCII | re.DOTALL)
_DIGITS = re.compile(r"(\d+)", re.ASCII)
ASSUMED_RATE = Fraction(25)
"""Images per second, if the settings do not determine it."""


@dataclass(frozen=True, slots=True)
class Orientation:
    """How a coded image becomes upright: mirrored left to right or not, then rotated.

    `rotation` is counter-clockwise: 0, 90, 180 or 270 degrees.
    """

    rotation: int = 0
    mirrored: bool = False

    @property
    def is_sideways(self) -> bool:
        """Whether width and height are swapped."""
        return self.rotation in (90, 270)

    @classmethod
    def of_exif(cls, number: int) -> "Orientation":
        """Return the orientation for an EXIF number, 1 to 8 (CIPA DC-008, 4.6.4)."""
        turns = {1: 0, 2: 0, 3: 180, 4: 180, 5: 90, 6: 270, 7: 270, 8: 90}
        return cls(turns[number], mirrored=number in (2, 4, 5, 7))

    @classmethod
    def of_frame(cls, image: "av.VideoFrame") -> "Orientation":
        """Return the nearest quarter turn of a decoded frame, by its display matrix."""
        return cls(round(image.rotation / 90) * 90 % 360)


def upright(image: Image, orientation: Orientation) -> Image:
    """Rotate and mirror `image` by `orientation`."""
    turned: cv2.typing.MatLike = cv2.flip(image, 1) if orientation.mirrored else image
    if orientation.rotation:
        turned = cv2.rotate(turned, _TURNS[orientation.rotation])
    return turned.astype(np.uint8, copy=False)


def read_image(path: Path, *, on_black: bool = False) -> Image:
    """Read an image, rotated upright by its EXIF data.

    A truncated JPEG file is read up to the cut, with a warning. With `on_black`, the image is laid
    on black where it is transparent.

    Returns
    -------
    BGR uint8 of shape `(H, W, 3)`. Grey becomes three equal channels, 16-bit values are scaled to
    8 bits (see `from_16_bits`), an alpha channel is dropped.

    Raises
    ------
    ImageError
        The file cannot be read, is a pipe, is not a PNG, JPEG, BMP, TIFF or WebP image, or is
        larger than `MAX_BYTES`; the image has more than `MAX_IMAGE_PIXELS`, or a side longer than
        `MAX_IMAGE_SIDE`.
    """
    data = read_encoded(path)
    image = _decode(data, path, on_black=on_black)
    if _is_cut_off(data):
        log.warning("%s: is truncated; read up to the cut", path)
    return image


def is_image_name(path: Path) -> bool:
    """Return whether a file has the name of an image, and is not hidden."""
    return path.suffix.lower() in IMAGE_SUFFIXES and not path.name.startswith(".")


def is_image_file(path: Path) -> bool:
    """Return whether a path is that of one image, not a pattern such as `img_%04d.png`."""
    return is_image_name(path) and ("%" not in path.name or path.is_file())


def read_header(path: Path) -> tuple[tuple[int, int], Orientation]:
    """Return width and height of the upright image, pixels, and its orientation.

    Only the header is decoded.

    Raises
    ------
    ImageError
        As for `read_image`.
    """
    image = _open(read_encoded(path), path)
    width, height = image.size
    turn = _orientation(image)
    if turn.is_sideways and image.format != "TIFF":
        width, height = height, width
    return (width, height), turn


def read_encoded(path: Path) -> bytes:
    """Return the content of an image file. Raises `ImageError`."""
    if path.is_fifo():  # it may never end, or never begin
        raise ImageError(f"{path}: can be read only once; save it to a file first")
    return read_whole(path, limit=MAX_BYTES, what="image", error=ImageError)


def decode_image(data: bytes) -> Image | None:
    """Decode an encoded image like `read_image`; None if it is not readable."""
    try:
        return _decode(data, Path())
    except ImageError:
        return None


def encode_image(image: Image, path: Path) -> bytes:
    """Encode an image in the format of the suffix of `path`. Raises `ImageError`."""
    with suppress(cv2.error):
        written, data = cv2.imencode(path.suffix, image)
        if written:
            return data.tobytes()
    raise ImageError(f"{path}: images must end in {', '.join(sorted(IMAGE_SUFFIXES))}")


def shrunk(image: Image, scale: float) -> Image:
    """Return an image `scale` times as large; from 1 on, the image itself."""
    if scale >= 1:
        return image
    height, width = (max(1, round(side * scale)) for side in image.shape[:2])
    return np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA), np.uint8)


def coarse_scale(vehicle: float, side: float) -> float:
    """Return the scale at which no face or plate of a picture is readable: see `output.coarse`.

    `vehicle` is the size of its largest vehicle, and `side` that of the picture, pixels. A vehicle
    that was not detected may be larger, up to a quarter of the picture.
    """
    return _COARSE_SIDE / max(vehicle, side / 4)


def from_16_bits(values: npt.NDArray[np.uint16]) -> Image:
    """Scale 16-bit values to 8 bits.

    If none is above 4095, the camera has 12 bits, and 4095 is white.
    """
    white = _12_BITS if values.max(initial=0) <= _12_BITS else _16_BITS
    return np.asarray(cv2.convertScaleAbs(values, alpha=255 / white), np.uint8)


def _is_cut_off(data: bytes) -> bool:
    """Return whether a JPEG file is truncated within its image. It may also have thumbnails."""
    return data.startswith(b"\xff\xd8") and data.rfind(_JPEG_END) < data.rfind(_JPEG_SCAN)


@contextmanager
def _naming_errors(path: Path) -> Iterator[None]:
    """Convert errors of Pillow to an `ImageError` that names `path`."""
    try:
        yield
    except MemoryError:
        raise
    except (pillow.DecompressionBombError, pillow.DecompressionBombWarning) as error:
        raise ImageError(f"{path}: {_TOO_LARGE}") from error
    except Exception as error:  # a dozen kinds on damaged data
        raise ImageError(f"{path}: {_NO_IMAGE}") from error


def _open(data: bytes, path: Path) -> ImageFile:
    """Read the header of an image. Raises `ImageError`, which names `path`."""
    with _naming_errors(path):
        image = pillow.open(io.BytesIO(data), formats=_FORMATS)
    if max(image.size) > MAX_IMAGE_SIDE or math.prod(image.size) > MAX_IMAGE_PIXELS:
        raise ImageError(f"{path}: {_TOO_LARGE}")
    return image


def _orientation(image: ImageFile) -> Orientation:
    with suppress(Exception):  # many kinds, if the EXIF data are damaged
        # The method of a PNG image would decode it to find EXIF data at its end.
        return Orientation.of_exif(pillow.Image.getexif(image).get(_ORIENTATION, 1))
    return Orientation()


def _decode(data: bytes, path: Path, *, on_black: bool = False) -> Image:
    image = _open(data + _JPEG_END if _is_cut_off(data) else data, path)
    # Pillow itself rotates TIFF.
    turn = Orientation() if image.format == "TIFF" else _orientation(image)
    with _naming_errors(path):
        bgr = _to_bgr(image, data)
        if on_black and (again := _open(data, path)).has_transparency_data:
            alpha = np.asarray(again.convert("RGBA").getchannel("A"))
            bgr = np.asarray(bgr * (alpha[..., np.newaxis] / 255), np.uint8)
        return upright(bgr, turn)


def _to_bgr(image: ImageFile, data: bytes) -> Image:
    """Decode and convert an image that was opened from `data`."""
    has_16_bits = any(";16" in str(tile.args) for tile in image.tile)
    image.load()
    if has_16_bits:  # Pillow keeps only 8
        values = cv2.imdecode(np.frombuffer(data, np.uint8), _ALL_BITS)
        return from_16_bits(np.asarray(values, np.uint16))
    if image.mode == "F":
        raise ValueError("grey values in floating point")
    image.info.pop("transparency", None)  # it is dropped; Pillow would warn about some kinds
    rgb = image if image.mode == "RGB" else image.convert("RGB")
    return np.asarray(cv2.cvtColor(np.asarray(rgb), cv2.COLOR_RGB2BGR), np.uint8)


def to_ycrcb(image: Image) -> tuple[Image, Image, Image]:
    """Return luma, red and blue chroma of an image, BGR `(H, W, 3)`; uint8 `(H, W)` each."""
    both = cv2.cvtColor(image, cv2.COLOR_BGR2YCrCb)
    # cv2.split fails if the garbage collector sees its unfinished tuple in another thread.
    luma, red, blue = (np.asarray(cv2.extractChannel(both, n), np.uint8) for n in range(3))
    return luma, red, blue


def numbered_images(path: Path) -> tuple[Path, ...]:
    """Return the images of the pattern or folder `path`, in order; empty if it is neither.

    They are in the order of their names, where numbers count as numbers: 9 is before 10. Those of a
    folder differ in numbers alone; each is a frame. Those of a pattern may begin at any number, and
    increase by any constant step. In the name of a folder, a per cent sign is literal.

    Raises
    ------
    VideoError
        The folder cannot be read, contains no such image, or several kinds of them; or one of a
        pattern is missing.
    """
    pattern = _PATTERN.fullmatch(path.name)
    if path.is_dir():
        folder, names = path, _NUMBERED
    elif pattern and not path.exists():
        folder, names = path.parent, _name_pattern(pattern)
    else:
        return ()
    try:
        images = [file for file in folder.iterdir() if names.fullmatch(file.name)]
    except OSError as error:
        raise VideoError(f"{path}: {folder} cannot be read: {error.strerror}") from error
    if names is _NUMBERED:
        images = list(filter(is_image_name, images))
    if not images:
        raise VideoError(f"{path}: no numbered images found; use a video, or -d DIR for a folder")
    if len({_DIGITS.sub("", file.name) for file in images}) > 1:
        raise VideoError(f"{path}: has several kinds of names; use a pattern, as in img_%04d.png")
    files = sorted(images, key=lambda file: [int(text) for text in _DIGITS.findall(file.name)])
    if names is not _NUMBERED:
        numbers = [int(names.sub(r"\1", file.name)) for file in files]
        step = min((later - number for number, later in pairwise(numbers)), default=1)
        for number, expected in zip(numbers, range(numbers[0], numbers[-1], step), strict=False):
            if number != expected:
                fault = f"image {expected} is missing; copy image {expected - step} in its place"
                raise VideoError(f"{path}: {fault}")
    return tuple(files)


def _name_pattern(pattern: re.Match[str]) -> re.Pattern[str]:
    """Return a regular expression for the names that a pattern such as `img_%04d.png` means."""
    before, digits, after = pattern.groups()
    number = r"0|[1-9]\d*" if digits is None else rf"\d{{{digits}}}|[1-9]\d{{{digits},}}"
    return re.compile(f"{re.escape(before)}({number}){re.escape(after)}", re.ASCII)
