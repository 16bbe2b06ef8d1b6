"""Which pictures a pattern names."""

import tempfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdet.errors import VideoError
from vdet.media.numbered import PictureSequence, find_sequence


def make(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).touch()


def test_pictures_begin_at_the_first_number_that_exists(tmp_path: Path) -> None:
    make(tmp_path, "a_0099.png", "a_0100.png", "a_0101.png", "a_0.png", "b_0001.png", "a_0050.jpg")
    pattern = str(tmp_path / "a_%04d.png")
    assert find_sequence(tmp_path / "a_%04d.png") == PictureSequence(pattern, 99)


def test_numbers_may_have_more_digits_than_the_pattern(tmp_path: Path) -> None:
    make(tmp_path, "98.png", "99.png", "100.png", "0101.png")
    found = find_sequence(tmp_path / "%02d.png")
    assert found == PictureSequence(str(tmp_path / "%02d.png"), 98)


def test_a_doubled_per_cent_sign_means_one(tmp_path: Path) -> None:
    folder = tmp_path / "50%d"
    folder.mkdir()
    make(folder, "100%_1.png", "100%%_7.png")
    found = find_sequence(folder / "100%%_%d.png")
    assert found == PictureSequence(f"{tmp_path}/50%%d/100%%_%d.png", 1)


class TestFolder:
    @pytest.mark.parametrize(
        ("names", "pattern"),
        [
            (["0000000007.png", "0000000008.png", "notes.txt"], "%010d.png"),
            (["9.jpg", "10.jpg", ".11.jpg"], "%d.jpg"),
            (["cam 2_img_099.png", "cam 2_img_100.png"], "cam 2_img_%03d.png"),
            (["100%_1_left.JPG"], "100%%_%d_left.JPG"),
        ],
    )
    def test_its_numbered_pictures_are_found(
        self, names: list[str], pattern: str, tmp_path: Path
    ) -> None:
        make(tmp_path, *names)
        found = find_sequence(tmp_path)
        assert found is not None
        assert found.pattern == f"{tmp_path}/{pattern}"

    @pytest.mark.parametrize(
        ("names", "words"),
        [
            (["a.png"], "has no numbered pictures; give a video"),
            (["1.png", "3.png", "4.png"], "picture 2 is missing; put a copy of 1"),
            (
                ["a_01.png", "a_02.png", "b_01.png"],
                "several kinds of names; give .*/a_%02d.png or .*/b_%02d.png",
            ),
        ],
    )
    def test_other_pictures_are_refused(self, names: list[str], words: str, tmp_path: Path) -> None:
        make(tmp_path, *names)
        with pytest.raises(VideoError, match=words):
            find_sequence(tmp_path)


def test_the_error_names_the_pattern_that_fits(tmp_path: Path) -> None:
    make(tmp_path, "img_0001.png", "img_0002.png")
    with pytest.raises(VideoError, match=r"no picture of such a name; give .*/img_%04d\.png$"):
        find_sequence(tmp_path / "img_%d.png")


@pytest.mark.parametrize(
    "name", ["in.mp4", "100%.mp4", "%s.png", "%4d.png", "%d-%d.png", "%%d.png"]
)
def test_a_name_that_is_no_pattern_is_a_file(name: str, tmp_path: Path) -> None:
    assert find_sequence(tmp_path / name) is None


@pytest.mark.parametrize(
    ("names", "words"),
    [
        ((), "there is no such file, and no picture of such a name"),
        (("img_1.png",), "no picture of such a name"),
        (("img_01.png", "img_03.png", "img_04.png"), "picture 2 is missing; put a copy of 1"),
        (
            ("img_06.png", "img_09.png", "img_15.png"),
            "picture 12 is missing; put a copy of 9",
        ),
        (("img_95.png", "img_98.png", "img_101.png"), "fill with zeros"),
    ],
)
def test_no_pictures_and_a_gap_are_refused(
    names: tuple[str, ...], words: str, tmp_path: Path
) -> None:
    make(tmp_path, *names)
    with pytest.raises(VideoError, match=words):
        find_sequence(tmp_path / "img_%02d.png")


def test_numbers_may_rise_by_a_step(tmp_path: Path) -> None:
    make(tmp_path, "7_0006.png", "7_0009.png", "7_0012.png")
    pattern = str(tmp_path / "7_%04d.png")
    assert find_sequence(tmp_path) == PictureSequence(pattern, 6, 3)


@given(
    before=st.text(st.sampled_from("ab-[(.*"), max_size=4),
    digits=st.none() | st.integers(1, 9),
    first=st.integers(0, 2000),
    count=st.integers(1, 4),
)
def test_a_pattern_matches_the_names_that_printf_makes(
    before: str, digits: int | None, first: int, count: int
) -> None:
    name = f"{before}_%{'' if digits is None else f'0{digits}'}d.png"
    with tempfile.TemporaryDirectory() as folder:
        make(Path(folder), *(name % number for number in range(first, first + count)))
        assert find_sequence(Path(folder) / name) == PictureSequence(f"{folder}/{name}", first)
