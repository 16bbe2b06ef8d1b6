"""Pictures: read to BGR uint8 from any common format, written whole or not at all."""

import contextlib
import logging
import math
import os
import re
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import cv2
import numpy as np
import numpy.typing as npt

from vdet.errors import ImageError, OutputError
from vdet.files import read_whole, staged
from vdet.media.picture_size import picture_size

Image = npt.NDArray[np.uint8]

MAX_PICTURE_PIXELS = 2**25
"""A picture of more pixels is not read: an 8K frame has fewer, a decompression bomb far more."""
MAX_PICTURE_SIDE = 2**15
MAX_BYTES = 256_000_000
"""Of a picture's file: enough for `MAX_PICTURE_PIXELS` of 16 bits without compression."""
PICTURE_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp"})

_NO_PICTURE = "is not a picture, or is damaged (PNG, JPEG, BMP, TIFF, WebP)"
_HARMLESS = ("[ WARN", "Warning", "libpng warning")
_PLACE = re.compile(r"^\[ERROR:\S+ global \S+ \w+ ")  # in OpenCV's source
_MAX_COMMENTS = 10_000  # bytes
_STDERR = 2
_stderr_lock = threading.Lock()  # the file descriptor belongs to the whole process

log = logging.getLogger("vdet")


def read_image(path: Path) -> Image:
    """Read a picture, turned upright as its EXIF data say.

    Returns
    -------
    BGR uint8 of shape `(H, W, 3)`. Grey becomes three equal channels, 16-bit values are scaled to
    8 bits, an alpha channel is dropped.

    Raises
    ------
    ImageError
        The file cannot be read, is not a PNG, JPEG, BMP, TIFF or WebP picture, or is larger than
        `MAX_BYTES`; the picture has more than `MAX_PICTURE_PIXELS`, or a side longer than
        `MAX_PICTURE_SIDE`.
    """
    data = read_whole(path, most=MAX_BYTES, what="picture", error=ImageError)
    try:
        image, complaint = _decode(data)
    except ImageError as error:
        raise ImageError(f"{path}: {error}") from error
    if complaint:
        log.warning("%s: is damaged, and read as far as possible (%s)", path, complaint)
    return image


def is_picture_name(path: Path) -> bool:
    """Return whether a file is named as a picture, and is not hidden."""
    return path.suffix.lower() in PICTURE_SUFFIXES and not path.name.startswith(".")


def read_size(path: Path) -> tuple[int, int]:
    """Return the width and height of a picture upright, in pixels, from its header alone.

    Raises
    ------
    ImageError
        The file cannot be read, or is no picture.
    """
    size = picture_size(read_whole(path, most=MAX_BYTES, what="picture", error=ImageError))
    if size is None:
        raise ImageError(f"{path}: {_NO_PICTURE}")
    return size


def decode_image(data: bytes) -> Image | None:
    """Decode an encoded picture as `read_image` does; None where that is impossible."""
    try:
        return _decode(data)[0]
    except ImageError:
        return None


def encode_image(image: Image, path: Path) -> bytes:
    """Encode a picture in the format that the suffix of `path` names. Raises `ImageError`."""
    try:
        written, data = cv2.imencode(path.suffix, image)
    except cv2.error:
        written = False
    if not written:
        raise ImageError(f"{path}: pictures are written as {', '.join(sorted(PICTURE_SUFFIXES))}")
    return data.tobytes()


def write_image(path: Path, image: Image, *, overwrite: bool = False) -> None:
    """Write a picture in the format that the suffix names. Raises `ImageError`, `OutputError`."""
    data = encode_image(image, path)
    with staged(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(data)


def _decode(data: bytes) -> tuple[Image, str]:
    """Return a picture, and the decoder's first complaint; an empty one where there is none."""
    size = picture_size(data)  # also keeps out formats for which OpenCV writes files of its own
    if size is None:
        raise ImageError(_NO_PICTURE)
    _check_size(*size)
    flags = cv2.IMREAD_COLOR_BGR | cv2.IMREAD_ANYDEPTH
    image = None
    try:
        with capture_stderr() as comments:
            image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as error:
        if error.code == cv2.Error.StsNoMem:
            raise MemoryError from error
    if image is None:
        raise ImageError(_NO_PICTURE)
    _check_size(*image.shape[:2])  # should a decoder find another size than its header claims
    complaints = [_PLACE.sub("", line) for line in comments if not line.startswith(_HARMLESS)]
    return _to_uint8(image), complaints[0] if complaints else ""


def _check_size(*sides: int) -> None:
    if max(sides) > MAX_PICTURE_SIDE or math.prod(sides) > MAX_PICTURE_PIXELS:
        raise ImageError(
            f"has more than {MAX_PICTURE_PIXELS:,} pixels, or a side of more than "
            f"{MAX_PICTURE_SIDE:,}; make it smaller"
        )


@contextlib.contextmanager
def capture_stderr() -> Iterator[list[str]]:
    """Keep standard error silent in the block; the list then holds the lines written to it.

    The C libraries that decode pictures comment there on damaged files.

    Raises
    ------
    OutputError
        There is no folder for temporary files.
    """
    lines: list[str] = []
    with _stderr_lock, _temporary_file() as file, contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):  # a process may have no standard error
            outside = os.dup(_STDERR)
            stack.callback(os.close, outside)
            stack.callback(os.dup2, outside, _STDERR)
            os.dup2(file.fileno(), _STDERR)
        yield lines
        file.seek(0)
        lines += file.read(_MAX_COMMENTS).decode("utf-8", "replace").splitlines()


def _temporary_file() -> IO[bytes]:
    try:
        return tempfile.TemporaryFile()
    except OSError as error:
        raise OutputError(
            f"there is no folder for temporary files ({error.strerror}); name one as TMPDIR"
        ) from error


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


def split_channels(image: Image) -> tuple[Image, Image, Image]:
    """Return the three channels of an image `(H, W, 3)`, uint8 `(H, W)` each."""
    # cv2.split fails where the garbage collector looks at its unfinished tuple in another thread.
    first, second, third = (np.asarray(cv2.extractChannel(image, n), np.uint8) for n in range(3))
    return first, second, third
