"""Which pictures a pattern or a folder names, and when each was taken."""

from fractions import Fraction
from pathlib import Path

import cv2
import pytest

from clips import draw_frame, read_number
from vdet.config.schema import InputSettings
from vdet.errors import VideoError
from vdet.media.images import find_sequence, is_image_file
from vdet.media.reader import VideoReader


def make(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).touch()


def names_of(path: Path) -> list[str]:
    found = find_sequence(path)
    assert found is not None
    return [file.name for file in found.files]


@pytest.mark.parametrize(
    ("pattern", "names", "others"),
    [
        ("a_%04d.png", ["a_0099.png", "a_0100.png"], ["a_0.png", "b_0001.png", "a_0050.jpg"]),
        ("%02d.png", ["98.png", "99.png", "100.png"], ["0101.png"]),
        ("100%%_%d.png", ["100%_1.png"], ["100%%_7.png"]),
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
        (["7_0006.png", "7_0009.png", "7_0012.png"], ["cover.png"]),
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
        ("", ["1.png", "3.png", "4.png"], "image 2 is missing; copy image 1"),
        ("", ["a_01.png", "a_02.png", "b_01.png"], SEVERAL),
        ("", ["1_01.png", "2_01.png"], SEVERAL),
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
        find_sequence(tmp_path / name)


@pytest.mark.parametrize(
    "name", ["in.mp4", "100%.mp4", "%s.png", "%4d.png", "%d-%d.png", "%%d.png"]
)
def test_a_name_that_is_no_pattern_is_a_file(name: str, tmp_path: Path) -> None:
    assert find_sequence(tmp_path / name) is None


NAMES = ["cam_20260501_070040.png", "cam_20260501_070050.png", "cam_20260501_070120.png"]


@pytest.mark.parametrize(
    ("rate", "times"), [(None, [0, 10, 40]), (25.0, [0, Fraction(1, 25), Fraction(2, 25)])]
)
def test_names_that_are_times_say_when_each_picture_is_shown(
    rate: float | None, times: list[Fraction], tmp_path: Path
) -> None:
    for number, name in enumerate(NAMES):
        assert cv2.imwrite(str(tmp_path / name), draw_frame(number, 160, 96))
    with VideoReader(tmp_path, settings=InputSettings(frame_rate=rate)) as reader:
        frames = list(reader)
        assert reader.info.frames == 3
    assert [frame.time for frame in frames] == times
    assert [read_number(frame.image) for frame in frames] == [0, 1, 2]
    with VideoReader(tmp_path, start=Fraction(10), settings=InputSettings()) as reader:
        assert [frame.index for frame in reader] == [1, 2]


def test_numbers_beside_one_time_are_numbers(tmp_path: Path) -> None:
    names = [f"20260501_070040_{number}.png" for number in (8, 9, 10)]
    make(tmp_path, *names)
    assert names_of(tmp_path) == names
    found = find_sequence(tmp_path)
    assert found is not None
    assert found.rate is None


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


@pytest.mark.parametrize(
    ("names", "milliseconds"),
    [
        (["20260501_070001_400", "20260501_070001_800", "20260501_070003_000"], [0, 400, 1600]),
        (["01-20260501070000-00", "01-20260501070001-00"], [0, 1000]),
        (["1-20260501070000-0", "1-20260501070000-1", "1-20260501070002-0"], [0, 500, 2000]),
        (["1777618800", "1777618801", "1777618805"], [0, 1000, 5000]),
        (["cam_1777618800123", "cam_1777618800623", "cam_1777618802123"], [0, 500, 2000]),
        (["20260501_070001_001", "20260501_070002_002", "20260501_070003_003"], [0, 1000, 2000]),
    ],
)
def test_names_are_times_to_the_millisecond(
    names: list[str], milliseconds: list[int], tmp_path: Path
) -> None:
    for number, name in enumerate(names):
        assert cv2.imwrite(str(tmp_path / f"{name}.png"), draw_frame(number, 160, 96))
    with VideoReader(tmp_path) as reader:
        frames = list(reader)
    assert [frame.time for frame in frames] == [Fraction(ms, 1000) for ms in milliseconds]
    assert [read_number(frame.image) for frame in frames] == list(range(len(names)))


@pytest.mark.parametrize(
    "names",
    [
        ["20260501_070000_001", "20260501_070000_002", "20260501_070001_003"],
        ["0000000000", "0000000001", "0000000002"],
    ],
)
def test_counters_are_no_times(names: list[str], tmp_path: Path) -> None:
    make(tmp_path, *(f"{name}.png" for name in names))
    found = find_sequence(tmp_path)
    assert found is not None
    assert (list(found.ticks), found.rate) == ([0, 1, 2], None)


def test_the_rate_of_names_that_are_times_is_the_usual_one(tmp_path: Path) -> None:
    for milliseconds in ("000", "201", "400", "601", "799", "999"):
        image = draw_frame(0, 160, 96)
        assert cv2.imwrite(str(tmp_path / f"20260501_070000_{milliseconds}.png"), image)
    with VideoReader(tmp_path) as reader:
        assert (reader.info.rate, reader.length) == (Fraction(1000, 200), Fraction(1199, 1000))
