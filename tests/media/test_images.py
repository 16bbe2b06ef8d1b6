"""Pictures: read from any common format, upright, and written whole."""

import io
import os
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image as pillow  # noqa: N813

from vdet.boxes import Image
from vdet.errors import ImageError
from vdet.media.images import decode_image, encode_image, read_header, read_image
from vdet.media.reader import VideoReader

IMAGE = np.random.default_rng(0).integers(0, 256, (24, 32, 3), dtype=np.uint8)


def smooth() -> Image:
    """Return a picture that JPEG keeps well: blue increases to the right, red downwards."""
    y, x = np.mgrid[0:48, 0:64]
    return np.stack([x * 4, np.full_like(x, 99), y * 5], axis=2).astype(np.uint8)


def encoded(suffix: str, image: np.ndarray) -> bytes:
    return cv2.imencode(suffix, image)[1].tobytes()


@pytest.mark.parametrize("suffix", [".png", ".bmp", ".tiff", ".PNG"])
def test_a_written_picture_is_read_back_the_same(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"picture{suffix}"
    path.write_bytes(encode_image(IMAGE, path))
    np.testing.assert_array_equal(read_image(path), IMAGE)


@pytest.mark.parametrize("suffix", [".jpg", ".jpeg", ".webp"])
def test_a_compressed_picture_is_read_back_nearly_the_same(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"picture{suffix}"
    path.write_bytes(encode_image(smooth(), path))
    image = read_image(path)
    assert image.dtype == np.uint8
    np.testing.assert_allclose(image, smooth(), atol=12)


def test_16_bit_values_are_rounded() -> None:
    deep = np.array([[0, 128, 129, 65406, 65407, 65535]], np.uint16)
    image = decode_image(encoded(".png", deep))
    assert image is not None
    assert image[0, :, 0].tolist() == [0, 0, 1, 254, 255, 255]


@pytest.mark.parametrize("suffix", [".png", ".tiff"])
@pytest.mark.parametrize("channels", [slice(0, 3), 0])
@pytest.mark.parametrize("white", [4095, 65_535])
def test_12_bit_values_in_16_bits_are_as_bright_as_others(
    tmp_path: Path, suffix: str, channels: slice | int, *, white: int
) -> None:
    path = tmp_path / f"0001{suffix}"
    deep = np.rint(IMAGE[..., channels] / 255 * white).astype(np.uint16)
    deep.flat[0] = white
    path.write_bytes(encoded(suffix, deep))
    expected = np.rint(deep / white * 255).reshape(24, 32, -1) * np.ones(3)
    np.testing.assert_array_equal(read_image(path), expected)
    with VideoReader(tmp_path) as reader:
        (frame,) = reader
        np.testing.assert_array_equal(frame.image, expected)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_alpha_is_dropped_and_grey_has_three_equal_channels(kind: type[np.generic]) -> None:
    scale = 257 if kind is np.uint16 else 1
    with_alpha = np.dstack([IMAGE, np.zeros((24, 32), np.uint8)]).astype(kind) * scale
    for source, expected in (
        (with_alpha, IMAGE),
        (with_alpha[..., 0], np.repeat(IMAGE[..., :1], 3, axis=2)),
    ):
        image = decode_image(encoded(".png", source.astype(kind)))
        assert image is not None
        np.testing.assert_array_equal(image, expected)


def turned(orientation: int, suffix: str) -> bytes:
    """Encode `smooth()`, with an orientation in its EXIF data."""
    exif = pillow.Exif()
    exif[0x0112] = orientation
    file = io.BytesIO()
    picture = pillow.fromarray(smooth()[..., ::-1])
    picture.save(file, pillow.registered_extensions()[suffix], exif=exif, lossless=True)
    return file.getvalue()


UPRIGHT = {
    1: smooth(),
    2: smooth()[:, ::-1],
    3: smooth()[::-1, ::-1],
    4: smooth()[::-1],
    5: smooth().transpose(1, 0, 2),
    6: np.rot90(smooth(), -1),
    7: smooth()[::-1, ::-1].transpose(1, 0, 2),
    8: np.rot90(smooth()),
    9: smooth(),  # there is no such orientation
}


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".webp", ".tif"])
@pytest.mark.parametrize("orientation", UPRIGHT)
def test_a_picture_is_turned_upright_as_its_exif_data_say(
    tmp_path: Path, orientation: int, suffix: str
) -> None:
    for number in (1, 2):
        (tmp_path / f"{number}{suffix}").write_bytes(turned(orientation, suffix))
    expected = UPRIGHT[orientation]
    np.testing.assert_allclose(read_image(tmp_path / f"1{suffix}"), expected, atol=12)
    assert read_header(tmp_path / f"1{suffix}")[0] == expected.shape[1::-1]
    with VideoReader(tmp_path / f"%d{suffix}") as reader:
        for frame in reader:
            np.testing.assert_allclose(frame.image, expected, atol=12)


@pytest.mark.parametrize("exif", [b"", b"MM\0*", b"MM\0*\0\0\0\x08\xff\xff"])
@pytest.mark.filterwarnings("ignore::UserWarning:PIL")
def test_damaged_exif_data_are_ignored(tmp_path: Path, exif: bytes) -> None:
    path = tmp_path / "a.jpg"
    pillow.fromarray(smooth()).save(path, exif=b"Exif\0\0" + exif)
    assert read_header(path)[0] == (64, 48)
    assert read_image(path).shape == (48, 64, 3)


def test_a_jpeg_that_was_cut_off_is_read_as_far_as_it_goes_with_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "cut.jpg"
    path.write_bytes(encoded(".jpg", smooth())[:-100])
    image = read_image(path)
    np.testing.assert_allclose(image[:8], smooth()[:8], atol=12)
    assert caplog.messages == [f"{path}: is truncated; read up to the cut"]


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"this is not a picture\n",
        encoded(".png", IMAGE)[:20],
        encoded(".jpg", IMAGE)[:100],
        b"\x89PNG\r\n\x1a\n",
    ],
    ids=["empty", "text", "cut png", "cut jpeg", "png signature alone"],
)
def test_the_error_names_a_file_that_is_no_picture(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "broken.png"
    path.write_bytes(data)
    with pytest.raises(ImageError, match=r"broken\.png: is not an image, or is damaged"):
        read_image(path)


@pytest.mark.parametrize("read", [read_image, read_header])
def test_a_pipe_is_refused_at_once(tmp_path: Path, read: Callable[[Path], object]) -> None:
    os.mkfifo(tmp_path / "pipe.png")
    with pytest.raises(ImageError, match=r"pipe\.png: can be read only once; save it to a"):
        read(tmp_path / "pipe.png")


@pytest.mark.parametrize("name", ["picture.xyz", "picture", "picture.txt"])
def test_the_error_for_an_unknown_suffix_lists_the_known_ones(name: str) -> None:
    with pytest.raises(ImageError, match=r"must end in .*\.jpg, .*\.png"):
        encode_image(IMAGE, Path(name))
