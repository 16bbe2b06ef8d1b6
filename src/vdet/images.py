"""Pictures: read to BGR uint8 from any common form, written whole or not at all."""

from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from vdet.errors import ImageError
from vdet.files import replacing

Image = npt.NDArray[np.uint8]

SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp"})


def read_image(path: Path) -> Image:
    """Read a picture, turned upright as its EXIF data say.

    Returns
    -------
    BGR uint8 of shape `(H, W, 3)`. Grey becomes three equal channels, 16-bit values are scaled to
    8 bits, an alpha channel is dropped.

    Raises
    ------
    ImageError
        The file cannot be read or is no picture that OpenCV knows.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ImageError(f"{path}: cannot be read: {error.strerror}") from error
    image = decode_image(data)
    if image is None:
        raise ImageError(f"{path}: is not a picture, or is damaged (PNG, JPEG, BMP, TIFF, WebP)")
    return image


def decode_image(data: bytes) -> Image | None:
    """Decode an encoded picture as `read_image` does; None where that cannot be done."""
    if not data:
        return None
    try:
        flags = cv2.IMREAD_COLOR_BGR | cv2.IMREAD_ANYDEPTH
        image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error:  # more pixels than OpenCV allows
        return None
    return None if image is None else _to_uint8(image)


def _to_uint8(image: npt.NDArray[np.generic]) -> Image:
    if image.dtype == np.uint8:
        return image.astype(np.uint8, copy=False)
    if image.dtype == np.uint16:
        return (image.astype(np.float32) / 257 + 0.5).astype(np.uint8)
    scaled = np.nan_to_num(image.astype(np.float32)).clip(0, 1)  # such pictures hold 0 to 1
    return (scaled * 255 + 0.5).astype(np.uint8)


def write_image(path: Path, image: Image) -> None:
    """Write a picture in the format that the suffix names. Raises `ImageError`, `OutputError`."""
    try:
        written, data = cv2.imencode(path.suffix, image)
    except cv2.error:
        written = False
    if not written:
        raise ImageError(f"{path}: pictures are written as {', '.join(sorted(SUFFIXES))}")
    with replacing(path) as temporary:
        temporary.write_bytes(data.tobytes())
