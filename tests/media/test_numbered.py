"""Which pictures a pattern or a folder names, and in which order."""

from fractions import Fraction
from pathlib import Path

import cv2
import pytest

from clips import draw_frame, read_number
from vdet.config.schema import InputSettings
from vdet.errors import VideoError
from vdet.media.images import is_image_file, numbered_images
from vdet.media.reader import VideoReader


def make(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).touch()


def names_of(path: Path) -> list[str]:
    return [file.name for file in numbered_images(path)]


@pytest.mark.parametrize(
    ("pattern", "names", "others"),
    [
        ("a_%04d.png", ["a_0099.png", "a_0100.png"], ["a_0.png", "b_0001.png", "a_0050.jpg"]),
        ("%02d.png", ["98.png", "99.png", "100.png"], ["0101.png"]),
        ("7_%d.png", ["7_0.png", "7_3.png", "7_6.png"], ["7_05.png"]),
    ],
)
def test_a_pattern_names_its_pictures(
    pattern: str, names: list[str], others: list[str], tmp_path: Path
) -> None:
    make(tmp_path, *reversed(names), *others)
    assert names_of(tmp_path / pattern) == names


@pytest.mark.parametrize(
    ("names", "others"),
    [
        (["0000000007.png", "0000000008.png"], ["notes.txt"]),
        (["9.jpg", "10.jpg"], [".11.jpg"]),
        (["cam 2_img_099.png", "cam 2_img_100.png"], []),
        (["100%_1_left.JPG"], []),
        (["7_0006.png", "7_0009.png", "7_0015.png"], ["cover.png"]),
        (["20260501_070001_400.jpg", "20260501_070003_0.jpg"], []),
        (["1_9.png", "1_10.png", "2_1.png"], []),
    ],
)
def test_the_numbered_pictures_of_a_folder_are_found(
    names: list[str], others: list[str], tmp_path: Path
) -> None:
    make(tmp_path, *reversed(names), *others)
    assert names_of(tmp_path) == names


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
