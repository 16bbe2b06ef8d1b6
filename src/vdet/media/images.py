"""Pictures: read to BGR uint8 from any common form, written whole or not at all."""

import logging
import re
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from vdet import MAX_PICTURE_PIXELS, MAX_PICTURE_SIDE
from vdet.errors import ImageError
from vdet.files import read_whole, replacing
from vdet.media.captured import capture_stderr

Image = npt.NDArray[np.uint8]

log = logging.getLogger("vdet")

MAX_BYTES = 256_000_000
"""Of a picture's file: enough for `MAX_PICTURE_PIXELS` of 16 bits, not compressed at all."""

PICTURE_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp"})


def read_image(path: Path) -> Image:
    """Read a picture, turned upright as its EXIF data say.

    Returns
    -------
    BGR uint8 of shape `(H, W, 3)`. Grey becomes three equal channels, 16-bit values are scaled to
    8 bits, an alpha channel is dropped.

    Raises
    ------
    ImageError
        The file cannot be read, is no picture that OpenCV knows, or is larger than `MAX_BYTES`;
        the picture has more than `MAX_PICTURE_PIXELS`, or a side longer than `MAX_PICTURE_SIDE`.
    """
    data = read_whole(path, most=MAX_BYTES, what="picture", error=ImageError)
    try:
        image, complaint = _decode(data)
    except ImageError as error:
        raise ImageError(f"{path}: {error}") from error
    if complaint:
        log.warning("%s: is damaged, and read as far as can be (%s)", path, complaint)
    return image


def decode_image(data: bytes) -> Image | None:
    """Decode an encoded picture as `read_image` does; None where that cannot be done."""
    try:
        return _decode(data)[0]
    except ImageError:
        return None


def _decode(data: bytes) -> tuple[Image, str]:
    """Return a picture, and what the decoder complained of; nothing, where all was well."""
    if not _is_known(data):
        raise ImageError(_NO_PICTURE)
    flags = cv2.IMREAD_COLOR_BGR | cv2.IMREAD_ANYDEPTH
    try:
        with capture_stderr() as comments:
            image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as error:
        if _SIZE_LIMIT in str(error):
            raise ImageError(
                f"has more than {MAX_PICTURE_PIXELS:,} pixels, or a side of more than "
                f"{MAX_PICTURE_SIDE:,}; make it smaller"
            ) from error
        image = None
    if image is None:
        raise ImageError(_NO_PICTURE)
    complaints = [_PLACE.sub("", line) for line in comments if not line.startswith(_HARMLESS)]
    return _to_uint8(image), complaints[0] if complaints else ""


def _is_known(data: bytes) -> bool:
    """Tell the formats that are read. For some others OpenCV writes files of its own."""
    if data.startswith(b"RIFF"):
        return data[8:12] == b"WEBP"
    return data.startswith(_SIGNATURES)


_SIGNATURES = (b"\x89PNG", b"\xff\xd8\xff", b"BM", b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_NO_PICTURE = "is not a picture, or is damaged (PNG, JPEG, BMP, TIFF, WebP)"
_HARMLESS = ("[ WARN", "Warning", "libpng warning")
_PLACE = re.compile(r"^\[ERROR:\S+ global \S+ \w+ ")  # in OpenCV's source
_SIZE_LIMIT = "CV_IO_MAX_IMAGE"  # OpenCV names the limit that a picture exceeds


def _to_uint8(image: cv2.typing.MatLike) -> Image:
    if image.dtype == np.uint8:
        return image.astype(np.uint8, copy=False)
    if image.dtype == np.uint16:
        return np.asarray(cv2.convertScaleAbs(image, alpha=1 / 257), np.uint8)
    scaled = np.empty(image.shape, np.uint8)
    for number, values in enumerate(image):  # row by row: all at once would take gigabytes
        shares = np.nan_to_num(values.astype(np.float32)).clip(0, 1)  # such pictures hold 0 to 1
        scaled[number] = shares * 255 + 0.5
    return scaled


def write_image(path: Path, image: Image) -> None:
    """Write a picture in the format that the suffix names. Raises `ImageError`, `OutputError`."""
    try:
        written, data = cv2.imencode(path.suffix, image)
    except cv2.error:
        written = False
    if not written:
        raise ImageError(f"{path}: pictures are written as {', '.join(sorted(PICTURE_SUFFIXES))}")
    with replacing(path) as temporary:
        temporary.write_bytes(data.tobytes())
