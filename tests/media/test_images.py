"""Pictures: read from any common format, upright, and written whole; numbered ones in order."""

import io
import os
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image as pillow  # noqa: N813

from clips import draw_frame, read_number
from vdet.boxes import Image
from vdet.config.schema import InputSettings
from vdet.errors import ImageError, VideoError
from vdet.media.images import (
    decode_image,
    encode_image,
    is_image_file,
    numbered_images,
    read_header,
    read_image,
)
from vdet.media.reader import VideoReader

IMAGE = np.random.default_rng(0).integers(0, 256, (24, 32, 3), dtype=np.uint8)


def smooth() -> Image:
    """Return a picture that JPEG keeps well: blue increases to the right, red downwards."""
    y, x = np.mgrid[0:48, 0:64]
    return np.stack([x * 4, np.full_like(x, 99), y * 5], axis=2).astype(np.uint8)


def encoded(suffix: str, image: np.ndarray) -> bytes:
    return cv2.imencode(suffix, image)[1].tobytes()


@pytest.mark.parametrize("suffix", [".png", ".bmp", ".tiff", ".PNG", ".jpg", ".jpeg", ".webp"])
def test_a_written_picture_is_read_back_the_same_or_compressed_nearly(
    tmp_path: Path, suffix: str
) -> None:
    path = tmp_path / f"picture{suffix}"
    path.write_bytes(encode_image(smooth(), path))
    is_compressed = suffix in (".jpg", ".jpeg", ".webp")
    np.testing.assert_allclose(read_image(path), smooth(), atol=12 if is_compressed else 0)


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


def make(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).touch()


@pytest.mark.parametrize(
    ("pattern", "names", "others"),
    [
        ("a_%04d.png", ["a_0099.png", "a_0100.png"], ["a_0.png", "b_0001.png", "a_0050.jpg"]),
        ("%02d.png", ["98.png", "99.png", "100.png"], ["0101.png"]),
        ("7_%d.png", ["7_0.png", "7_3.png", "7_6.png"], ["7_05.png"]),
        ("", ["0000000007.png", "0000000008.png"], ["notes.txt"]),
        ("", ["9.jpg", "10.jpg"], [".11.jpg"]),
        ("", ["cam 2_img_099.png", "cam 2_img_100.png"], []),
        ("", ["100%_1_left.JPG"], []),
        ("", ["7_0006.png", "7_0009.png", "7_0015.png"], ["cover.png"]),
        ("", ["20260501_070001_400.jpg", "20260501_070003_0.jpg"], []),
        ("", ["1_9.png", "1_10.png", "2_1.png"], []),
    ],
)
def test_a_pattern_or_a_folder_has_its_numbered_pictures_in_order(
    pattern: str, names: list[str], others: list[str], tmp_path: Path
) -> None:
    make(tmp_path, *reversed(names), *others)
    assert [file.name for file in numbered_images(tmp_path / pattern)] == names


SEVERAL = "several kinds of names; use a pattern, as in img_%04d.png"


@pytest.mark.parametrize(
    ("name", "names", "words"),
    [
        ("", ["a.png"], "no numbered images found; use a video, or -d DIR"),
        ("", ["a_01.png", "a_02.png", "b_01.png"], SEVERAL),
        ("img_%02d.png", [], "no numbered images found"),
        ("img_%02d.png", ["img_1.png"], "no numbered images found"),
        ("img_%02d.png", ["img_06.png", "img_09.png", "img_15.png"], "image 12 is missing"),
    ],
)
def test_no_pictures_and_a_gap_are_refused(
    name: str, names: list[str], words: str, tmp_path: Path
) -> None:
    make(tmp_path, *names)
    with pytest.raises(VideoError, match=words):
        numbered_images(tmp_path / name)


@pytest.mark.parametrize(
    "name", ["in.mp4", "100%.mp4", "%s.png", "%4d.png", "%d-%d.png", "%%d.png"]
)
def test_a_name_that_is_no_pattern_is_a_file(name: str, tmp_path: Path) -> None:
    assert not numbered_images(tmp_path / name)


@pytest.mark.parametrize("content", [b"", b"no image"])
@pytest.mark.parametrize("start", [0, 5, 25])
def test_frames_keep_their_numbers_after_an_image_that_cannot_be_decoded(
    content: bytes, start: int, tmp_path: Path
) -> None:
    for number in range(40):
        assert cv2.imwrite(str(tmp_path / f"{number}.jpg"), draw_frame(number, 160, 96))
    (tmp_path / "20.jpg").write_bytes(content)
    settings = InputSettings(frame_rate=25, max_damaged=0.1)
    with VideoReader(tmp_path, start=Fraction(start, 25), settings=settings) as reader:
        frames = list(reader)
        assert start == 25 or reader.damaged == 1
    expected = [number for number in range(start, 40) if number != 20]
    assert [frame.index for frame in frames] == expected
    assert [frame.time for frame in frames] == [Fraction(number, 25) for number in expected]
    assert [read_number(frame.image) for frame in frames] == expected


@pytest.mark.parametrize("name", ["a%b.png", "a%d.png"])
def test_an_image_with_a_per_cent_sign_is_an_image(name: str, tmp_path: Path) -> None:
    assert not is_image_file(tmp_path / name)
    make(tmp_path, name)
    assert is_image_file(tmp_path / name)
