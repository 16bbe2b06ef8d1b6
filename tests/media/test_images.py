"""Pictures: read from any common format, written whole; comments of the decoders captured."""

import os
import struct
import subprocess
import sys
import threading
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdet.errors import ImageError, OutputError, in_one_line
from vdet.media import VideoReader
from vdet.media.images import (
    Image,
    capture_stderr,
    decode_image,
    read_image,
    read_size,
    write_image,
)

PICTURE = np.random.default_rng(0).integers(0, 256, (24, 32, 3), dtype=np.uint8)


def smooth() -> Image:
    """Return a picture that JPEG keeps well: blue increases to the right, red downwards."""
    y, x = np.mgrid[0:48, 0:64]
    return np.stack([x * 4, np.full_like(x, 99), y * 5], axis=2).astype(np.uint8)


def encoded(suffix: str, image: np.ndarray) -> bytes:
    return cv2.imencode(suffix, image)[1].tobytes()


def turned_jpeg(image: Image, orientation: int) -> bytes:
    """Encode as JPEG, with only the orientation in its EXIF segment."""
    entry = struct.pack(">HHIHH", 0x0112, 3, 1, orientation, 0)
    exif = b"Exif\0\0MM\0*\0\0\0\x08" + struct.pack(">H", 1) + entry + bytes(4)
    jpeg = encoded(".jpg", image)
    return jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + jpeg[2:]


@pytest.mark.parametrize("suffix", [".png", ".bmp", ".tiff", ".PNG"])
def test_a_written_picture_is_read_back_the_same(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"picture{suffix}"
    write_image(path, PICTURE)
    np.testing.assert_array_equal(read_image(path), PICTURE)


@pytest.mark.parametrize("suffix", [".jpg", ".jpeg", ".webp"])
def test_a_compressed_picture_is_read_back_nearly_the_same(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"picture{suffix}"
    write_image(path, smooth())
    image = read_image(path)
    assert image.dtype == np.uint8
    np.testing.assert_allclose(image, smooth(), atol=12)


def test_a_path_need_not_be_ascii(tmp_path: Path) -> None:
    path = tmp_path / "Straße_車.png"
    write_image(path, PICTURE)
    np.testing.assert_array_equal(read_image(path), PICTURE)


def test_without_a_folder_for_temporary_files_that_is_what_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail() -> None:
        raise FileNotFoundError(2, "No usable temporary directory found in ['/tmp', '/']")

    write_image(tmp_path / "a.png", PICTURE)
    monkeypatch.setattr("tempfile.TemporaryFile", fail)
    with pytest.raises(OutputError, match=r"no folder for temporary files \(.*\); name one as TMP"):
        read_image(tmp_path / "a.png")


def test_too_little_memory_is_not_blamed_on_the_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        error = cv2.error("Failed to allocate 72000000 bytes")
        error.code = cv2.Error.StsNoMem
        raise error

    write_image(tmp_path / "a.png", PICTURE)
    monkeypatch.setattr("cv2.imdecode", fail)
    with pytest.raises(MemoryError) as caught:
        read_image(tmp_path / "a.png")
    assert in_one_line(caught.value).startswith("there is too little memory; ")


def test_the_content_decides_on_the_format_not_the_suffix(tmp_path: Path) -> None:
    path = tmp_path / "picture.jpg"
    path.write_bytes(encoded(".png", PICTURE))
    np.testing.assert_array_equal(read_image(path), PICTURE)


def test_16_bit_values_are_scaled_to_8_bits(tmp_path: Path) -> None:
    path = tmp_path / "deep.png"
    path.write_bytes(encoded(".png", PICTURE.astype(np.uint16) * 257))
    image = read_image(path)
    assert image.dtype == np.uint8
    np.testing.assert_array_equal(image, PICTURE)


def test_16_bit_values_are_rounded() -> None:
    deep = np.array([[0, 128, 129, 65406, 65407, 65535]], np.uint16)
    image = decode_image(encoded(".png", deep))
    assert image is not None
    assert image[0, :, 0].tolist() == [0, 0, 1, 254, 255, 255]


def test_a_grey_picture_has_three_equal_channels() -> None:
    image = decode_image(encoded(".png", PICTURE[..., 0]))
    assert image is not None
    np.testing.assert_array_equal(image, np.repeat(PICTURE[..., :1], 3, axis=2))


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_alpha_is_dropped(kind: type[np.generic]) -> None:
    scale = 257 if kind is np.uint16 else 1
    with_alpha = np.dstack([PICTURE, np.zeros((24, 32), np.uint8)]).astype(kind) * scale
    image = decode_image(encoded(".png", with_alpha.astype(kind)))
    assert image is not None
    np.testing.assert_array_equal(image, PICTURE)


def test_floating_point_values_run_from_0_to_1() -> None:
    values = np.array([[-1, 0, 0.5, 1, 7, np.nan]], np.float32)
    image = decode_image(encoded(".tiff", np.dstack([values] * 3)))
    assert image is not None
    assert image[0, :, 0].tolist() == [0, 0, 128, 255, 255, 0]


@pytest.mark.parametrize(
    ("orientation", "turns"), [(1, 0), (3, 2), (6, -1), (8, 1)]
)  # turns counter-clockwise that bring it upright
def test_a_photograph_is_turned_upright_as_its_exif_data_say(orientation: int, turns: int) -> None:
    image = decode_image(turned_jpeg(smooth(), orientation))
    assert image is not None
    np.testing.assert_allclose(image, np.rot90(smooth(), turns), atol=12)


@pytest.mark.parametrize("orientation", [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 1000])
def test_the_size_alone_is_that_of_the_picture_upright(tmp_path: Path, orientation: int) -> None:
    path = tmp_path / "a.jpg"
    path.write_bytes(turned_jpeg(smooth(), orientation))
    height, width = read_image(path).shape[:2]
    assert read_size(path) == (width, height)


@pytest.mark.parametrize("orientation", range(10))
def test_numbered_photographs_are_as_upright_as_each_alone(
    tmp_path: Path, orientation: int
) -> None:
    for number in (1, 2):
        (tmp_path / f"{number}.jpg").write_bytes(turned_jpeg(smooth(), orientation))
    expected = read_image(tmp_path / "1.jpg")
    with VideoReader(tmp_path / "%d.jpg") as reader:
        frames = [frame.image for frame in reader]
    assert len(frames) == 2
    for image in frames:
        np.testing.assert_allclose(image, expected, atol=12)


@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
def test_numbered_pictures_of_another_format_are_turned_too(
    tmp_path: Path, orientation: int
) -> None:
    exif = b"eXIfMM\0*\0\0\0\x08\0\1" + struct.pack(">HHIHHI", 0x0112, 3, 1, orientation, 0, 0)
    chunk = struct.pack(">I", len(exif) - 4) + exif + struct.pack(">I", zlib.crc32(exif))
    png = encoded(".png", smooth())
    for number in (1, 2):
        (tmp_path / f"{number}.png").write_bytes(png[:33] + chunk + png[33:])
    expected = read_image(tmp_path / "1.png")
    assert (expected.shape[0] > expected.shape[1]) == (orientation in {6, 8})
    with VideoReader(tmp_path / "%d.png") as reader:
        for frame in reader:
            np.testing.assert_allclose(frame.image, expected, atol=2)


@pytest.mark.parametrize(
    "exif", [b"", b"MM\0*", b"II*\0\xff\xff\xff\xff", b"MM\0*\0\0\0\x08\xff\xff"]
)
def test_damaged_exif_data_do_not_turn_the_size(tmp_path: Path, exif: bytes) -> None:
    segment = b"Exif\0\0" + exif
    jpeg = encoded(".jpg", smooth())
    path = tmp_path / "a.jpg"
    path.write_bytes(
        jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(segment) + 2) + segment + jpeg[2:]
    )
    assert read_size(path) == (64, 48)


def test_the_size_of_what_is_no_picture_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(b"junk")
    with pytest.raises(ImageError, match=r"a\.jpg: is not a picture"):
        read_size(tmp_path / "a.jpg")


def test_a_picture_of_one_pixel_is_read() -> None:
    image = decode_image(encoded(".png", np.full((1, 1, 3), 7, np.uint8)))
    assert image is not None
    assert image.tolist() == [[[7, 7, 7]]]


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ImageError, match=r"no\.png: cannot be read: No such file"):
        read_image(tmp_path / "no.png")


def test_a_folder_is_no_picture(tmp_path: Path) -> None:
    with pytest.raises(ImageError, match="cannot be read: Is a directory"):
        read_image(tmp_path)


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"this is not a picture\n",
        encoded(".png", PICTURE)[:20],
        encoded(".jpg", PICTURE)[:100],
        b"\x89PNG\r\n\x1a\n",
    ],
    ids=["empty", "text", "cut png", "cut jpeg", "png signature alone"],
)
def test_the_error_names_a_file_that_is_no_picture(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "broken.png"
    path.write_bytes(data)
    with pytest.raises(ImageError, match=r"broken\.png: is not a picture, or is damaged"):
        read_image(path)


@given(
    st.sampled_from([".png", ".jpg", ".bmp", ".tiff", ".webp"]),
    st.integers(0, 300),
    st.binary(max_size=40),
)
def test_any_bytes_are_a_picture_or_none(suffix: str, kept: int, junk: bytes) -> None:
    image = decode_image(encoded(suffix, PICTURE)[:kept] + junk)
    assert image is None or (image.dtype == np.uint8 and image.ndim == 3)


def test_a_picture_that_claims_a_trillion_pixels_is_refused() -> None:
    header = struct.pack(">IIBBBBB", 1_000_000, 1_000_000, 8, 2, 0, 0, 0)
    png = encoded(".png", PICTURE)
    chunk = b"IHDR" + header
    bomb = png[:12] + chunk + struct.pack(">I", zlib.crc32(chunk)) + png[33:]
    assert decode_image(bomb) is None


@pytest.mark.parametrize("name", ["picture.xyz", "picture", "picture.txt"])
def test_the_error_for_an_unknown_suffix_lists_the_known_ones(tmp_path: Path, name: str) -> None:
    with pytest.raises(ImageError, match=r"written as .*\.jpg, .*\.png"):
        write_image(tmp_path / name, PICTURE)
    assert list(tmp_path.iterdir()) == []


def test_a_picture_is_not_written_into_a_missing_folder(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot be written"):
        write_image(tmp_path / "no" / "picture.png", PICTURE)


@pytest.mark.parametrize("module", ["vdet", "vdet.media.images"])
def test_an_import_leaves_the_environment_unchanged(module: str) -> None:
    # OpenCV sets variables of its own.
    before = "import os, cv2; before = dict(os.environ)"
    code = f"{before}; import {module}; assert dict(os.environ) == before"
    subprocess.run([sys.executable, "-c", code], check=True)


def write_stderr(text: str) -> None:
    os.write(2, text.encode())


def test_what_is_written_in_the_block_is_kept_and_not_shown(
    capfd: pytest.CaptureFixture[str],
) -> None:
    write_stderr("before\n")
    with capture_stderr() as lines:
        write_stderr("one\ntwo\n")
    write_stderr("after\n")
    assert lines == ["one", "two"]
    assert capfd.readouterr().err == "before\nafter\n"


def test_of_endless_lines_the_first_are_kept() -> None:
    with capture_stderr() as lines:
        for _ in range(1000):
            write_stderr("x" * 99 + "\n")
    assert 10 < len(lines) <= 100


def test_standard_error_is_restored_after_an_error(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(KeyError), capture_stderr():
        raise KeyError
    write_stderr("after\n")
    assert capfd.readouterr().err == "after\n"


def test_threads_capture_in_turn(capfd: pytest.CaptureFixture[str]) -> None:
    caught: list[list[str]] = []

    def capture(number: int) -> None:
        for _ in range(20):
            with capture_stderr() as lines:
                write_stderr(f"{number}\n" * 3)
            caught.append(lines)

    threads = [threading.Thread(target=capture, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(len(lines) == 3 and len(set(lines)) == 1 for lines in caught)
    assert len(caught) == 80
    write_stderr("after\n")
    assert capfd.readouterr().err == "after\n"
