"""The size and the orientation that the header of a picture file claims.

They are read before the picture is decoded.

A decompression bomb is a file of a few kilobytes that claims gigabytes of pixels. Decoders set
memory aside for what a header claims, so it is read here first, in the way that they read it.
"""

import contextlib
import struct
from collections.abc import Callable, Set

_MAX_TIFF_TAGS = 4096  # as in libtiff
_TIFF_WIDTH, _TIFF_HEIGHT, _TIFF_ORIENTATION = 256, 257, 274
_TIFF_INTEGERS = {1: "B", 3: "H", 4: "I", 6: "b", 8: "h", 9: "i", 16: "Q", 17: "q"}
_JPEG = b"\xff\xd8\xff"
_JPEG_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_JPEG_WITHOUT_LENGTH = frozenset({0x00, 0x01, *range(0xD0, 0xD8)})
_JPEG_EXIF, _EXIF = 0xE1, b"Exif\0\0"
_ORIENTATIONS = range(1, 9)
_TURNED = range(5, 9)  # by a quarter


def picture_size(data: bytes) -> tuple[int, int] | None:
    """Return the width and height in pixels that a PNG, JPEG, BMP, TIFF or WebP file claims.

    They are those of the picture upright, as far as the EXIF data of a JPEG file turn it.
    None where the file is none of these, or its header is damaged.
    """
    for signature, parse in _FORMATS.items():
        if data.startswith(signature):
            try:
                return parse(data)
            except (struct.error, LookupError, OverflowError, ValueError):
                return None
    return None


def _png(data: bytes) -> tuple[int, int]:
    if data[12:16] != b"IHDR":
        raise ValueError
    width, height = struct.unpack_from(">II", data, 16)
    return width, height


def jpeg_orientation(data: bytes) -> int | None:
    """Return the orientation, 1 to 8, of the EXIF data in a JPEG file, 1 where it has none.

    None where the file is of another format, or its header is damaged.
    """
    if data.startswith(_JPEG):
        with contextlib.suppress(struct.error, LookupError, OverflowError, ValueError):
            return _jpeg_header(data)[2]
    return None


def _jpeg(data: bytes) -> tuple[int, int]:
    width, height, orientation = _jpeg_header(data)
    return (height, width) if orientation in _TURNED else (width, height)


def _jpeg_header(data: bytes) -> tuple[int, int, int]:
    """Return width and height as coded, and the orientation.

    They stand in the first start of a frame (ITU-T T.81, annex B) and in a segment before it.
    """
    position, orientation = 2, 1
    while True:
        position = data.index(b"\xff", position)
        while data[position] == 0xFF:
            position += 1
        marker = data[position]
        position += 1
        if marker in _JPEG_FRAMES:
            height, width = struct.unpack_from(">HH", data, position + 3)
            return width, height, orientation
        if marker not in _JPEG_WITHOUT_LENGTH:
            (length,) = struct.unpack_from(">H", data, position)
            segment = data[position + 2 : position + length]
            if marker == _JPEG_EXIF and segment.startswith(_EXIF):
                orientation = _orientation(segment[len(_EXIF) :])
            position += max(2, length)


def _orientation(exif: bytes) -> int:
    """Return the orientation in EXIF data, which are a TIFF file; 1 where there is no valid one."""
    with contextlib.suppress(struct.error, LookupError, ValueError):
        orientation = _tiff_tags(exif, {_TIFF_ORIENTATION})[_TIFF_ORIENTATION]
        return orientation if orientation in _ORIENTATIONS else 1
    return 1


def _bmp(data: bytes) -> tuple[int, int]:
    (header,) = struct.unpack_from("<I", data, 14)
    width, height = struct.unpack_from("<HH" if header == 12 else "<ii", data, 18)
    return width, abs(height)


def _webp(data: bytes) -> tuple[int, int]:
    """Read the first chunk (RFC 9649): the canvas, or the one picture."""
    chunk = data[8:16]
    if chunk[:4] != b"WEBP":
        raise ValueError
    if chunk[4:] == b"VP8X":
        return 1 + int.from_bytes(data[24:27], "little"), 1 + int.from_bytes(data[27:30], "little")
    if chunk[4:] == b"VP8L":
        (bits,) = struct.unpack_from("<I", data, 21)
        return 1 + (bits & 0x3FFF), 1 + (bits >> 14 & 0x3FFF)
    if chunk[4:] == b"VP8 ":
        width, height = struct.unpack_from("<HH", data, 26)
        return width & 0x3FFF, height & 0x3FFF
    raise ValueError


def _tiff(data: bytes) -> tuple[int, int]:
    sizes = _tiff_tags(data, {_TIFF_WIDTH, _TIFF_HEIGHT})
    return sizes[_TIFF_WIDTH], sizes[_TIFF_HEIGHT]


def _tiff_tags(data: bytes, wanted: Set[int]) -> dict[int, int]:
    """Read whole numbers in the first directory of a TIFF 6.0 or BigTIFF file."""
    order = "<" if data.startswith(b"II") else ">"
    big = 43 in data[2:4]
    (offset,) = struct.unpack_from(order + ("Q" if big else "I"), data, 8 if big else 4)
    (count,) = struct.unpack_from(order + ("Q" if big else "H"), data, offset)
    if count > _MAX_TIFF_TAGS:
        raise ValueError
    first, step, value = (offset + 8, 20, 12) if big else (offset + 2, 12, 8)
    found: dict[int, int] = {}
    for entry in range(first, first + count * step, step):
        tag, kind = struct.unpack_from(order + "HH", data, entry)
        if tag in wanted and tag not in found:
            (found[tag],) = struct.unpack_from(order + _TIFF_INTEGERS[kind], data, entry + value)
    return found


_FORMATS: dict[bytes, Callable[[bytes], tuple[int, int]]] = {
    b"\x89PNG\r\n\x1a\n": _png,
    _JPEG: _jpeg,
    b"BM": _bmp,
    b"RIFF": _webp,
    b"II*\0": _tiff,
    b"MM\0*": _tiff,
    b"II+\0": _tiff,
    b"MM\0+": _tiff,
}
