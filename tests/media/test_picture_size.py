"""The size that a header claims is the size that the decoder would make."""

import struct

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hostile.mutations import mutated
from vdet.media.picture_size import picture_size

IMAGE = np.random.default_rng(0).integers(0, 256, (24, 40, 3), dtype=np.uint8)
ALPHA = np.dstack([IMAGE, IMAGE[..., :1]])
PICTURES: dict[str, tuple[str, np.ndarray, list[int]]] = {
    "png": (".png", IMAGE, []),
    "16-bit png": (".png", IMAGE.astype(np.uint16) * 257, []),
    "jpeg": (".jpg", IMAGE, []),
    "progressive jpeg": (".jpg", IMAGE, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1]),
    "bmp": (".bmp", IMAGE, []),
    "bmp with alpha": (".bmp", ALPHA, []),
    "tiff": (".tiff", IMAGE, []),
    "grey tiff": (".tiff", IMAGE[..., 0], [cv2.IMWRITE_TIFF_COMPRESSION, 1]),
    "lossy webp": (".webp", IMAGE, [cv2.IMWRITE_WEBP_QUALITY, 80]),
    "lossless webp": (".webp", IMAGE, [cv2.IMWRITE_WEBP_QUALITY, 101]),
    "webp with alpha": (".webp", ALPHA, [cv2.IMWRITE_WEBP_QUALITY, 80]),
}


def encoded(name: str) -> bytes:
    suffix, image, options = PICTURES[name]
    return cv2.imencode(suffix, image, options)[1].tobytes()


def tiff(order: str, *, big: bool) -> bytes:
    """Encode nothing but a header and the two sizes, 70000 × 500, as LONG and SHORT."""
    mark = b"II" if order == "<" else b"MM"
    if big:
        entries = struct.pack(order + "HHQI4xHHQH6x", 256, 4, 1, 70_000, 257, 3, 1, 500)
        return mark + struct.pack(order + "HHHQQ", 43, 8, 0, 16, 2) + entries
    entries = struct.pack(order + "HHIIHHIH2x", 256, 4, 1, 70_000, 257, 3, 1, 500)
    return mark + struct.pack(order + "HIH", 42, 8, 2) + entries


@pytest.mark.parametrize("name", PICTURES)
def test_the_size_is_read_from_the_header(name: str) -> None:
    assert picture_size(encoded(name)) == (40, 24)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("big", [False, True])
def test_tiff_has_two_byte_orders_and_two_forms(order: str, big: bool) -> None:
    assert picture_size(tiff(order, big=big)) == (70_000, 500)


def test_segments_and_fill_bytes_before_the_frame_of_a_jpeg_are_passed() -> None:
    jpeg = encoded("jpeg")
    thumbnail = jpeg[:2] + b"\xff\xe1" + struct.pack(">H", 2 + len(jpeg)) + jpeg  # as EXIF has it
    fake = jpeg.replace(struct.pack(">HH", 24, 40), struct.pack(">HH", 9, 9))
    assert picture_size(thumbnail + b"\xff\xff\xff\x01\xff\xd0junk" + fake[2:]) == (9, 9)


def test_a_bmp_may_be_stored_from_the_top() -> None:
    bmp = encoded("bmp")
    assert picture_size(bmp[:22] + struct.pack("<i", -24) + bmp[26:]) == (40, 24)


@pytest.mark.parametrize("name", PICTURES)
def test_a_damaged_picture_is_never_decoded_to_a_size_not_claimed(name: str) -> None:
    flags = cv2.IMREAD_COLOR_BGR | cv2.IMREAD_IGNORE_ORIENTATION
    for data in mutated(encoded(name), seed=3, count=100):
        size = picture_size(data)
        if data and (size is None or size[0] * size[1] < 10**6):
            image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
            assert image is None or image.shape[1::-1] == size


@given(st.sampled_from([encoded(name)[:4] for name in PICTURES]), st.binary(max_size=80))
def test_any_bytes_have_a_size_or_none(signature: bytes, data: bytes) -> None:
    size = picture_size(signature + data)
    assert size is None or len(size) == 2


@pytest.mark.parametrize("suffix", [".gif", ".ppm", ".ras"])
def test_other_formats_have_none(suffix: str) -> None:
    assert picture_size(cv2.imencode(suffix, IMAGE)[1].tobytes()) is None
