"""The videos of a batch, from files and folders."""

import os
from pathlib import Path

import pytest

from vdet.batch.run import find_sources
from vdet.errors import BatchError


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder as a camera leaves it; it is the current folder."""
    for name in (
        "clips/b.mp4", "clips/b.vdet.mp4", "clips/a.MOV", "clips/a.srt", "clips/._a.MOV",
        "clips/.trash/old.mp4", "clips/day1/c.avi", "clips/day1/evening/d.ts", "clips/day2/c.avi",
        "clips/notes.txt", "odd [1].mp4", "camera.raw",
    ):  # fmt: skip
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def found(*clips: str) -> list[tuple[str, str]]:
    sources = find_sources([Path(clip) for clip in clips])
    return [(str(source.path), str(source.relative_path)) for source in sources]


@pytest.mark.usefixtures("folder")
class TestFound:
    def test_a_file_is_taken_whatever_its_suffix(self) -> None:
        assert found("clips/day1/c.avi", "camera.raw") == [
            ("clips/day1/c.avi", "c.avi"),
            ("camera.raw", "camera.raw"),
        ]

    def test_a_folder_gives_the_videos_in_it_and_below_but_no_hidden_or_drawn_ones(self) -> None:
        assert found("clips") == [
            ("clips/a.MOV", "a.MOV"),
            ("clips/b.mp4", "b.mp4"),
            ("clips/day1/c.avi", "day1/c.avi"),
            ("clips/day1/evening/d.ts", "day1/evening/d.ts"),
            ("clips/day2/c.avi", "day2/c.avi"),
        ]

    def test_a_file_whose_name_looks_like_a_pattern_is_itself(self) -> None:
        assert found("odd [1].mp4") == [("odd [1].mp4", "odd [1].mp4")]

    def test_a_video_that_is_named_twice_is_taken_once(self, folder: Path) -> None:
        (folder / "link").symlink_to(folder / "clips")
        assert found("clips", "clips/b.mp4", "link/b.mp4", "clips/../clips") == found("clips")


def pictures(folder: Path, *numbers: int) -> Path:
    folder.mkdir(parents=True)
    for number in numbers:
        (folder / f"{number:010d}.png").touch()
    return folder


@pytest.mark.usefixtures("folder")
class TestPictures:
    @pytest.mark.parametrize("name", ["frames", "frames.v2"])
    def test_a_folder_of_numbered_pictures_is_a_video_with_its_name(self, name: str) -> None:
        folder = pictures(Path(name), 7, 8, 9)
        assert found(name) == [(name, f"{name}.png")]
        os.chdir(folder)
        assert found(".") == [(".", f"{name}.png")]

    def test_pictures_of_several_kinds_are_left_out_with_a_warning(
        self, caplog: pytest.LogCaptureFixture
    ) -> None:
        (pictures(Path("drives/one"), 0, 2, 3) / "front_0.png").touch()
        pictures(Path("drives/two"), 0, 1)
        assert [place for _, place in found("drives")] == ["two.png"]
        assert "drives/one: has several kinds of names" in caplog.text

    def test_a_pattern_of_numbered_pictures_is_a_video_with_the_name_of_the_folder(self) -> None:
        pictures(Path("frames"), 3, 4)
        assert found("frames/%010d.png") == [("frames/%010d.png", "frames.png")]


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    ("clip", "words"),
    [
        ("none.mp4", "none.mp4: no video found"),
        ("none/", "none: no video found"),
        ("empty", "empty: no video found"),
        ("*.mkv", r"\*.mkv: no video found"),
    ],
)
def test_a_clip_that_gives_no_video_is_named(clip: str, words: str) -> None:
    with pytest.raises(BatchError, match=f"^{words}"):
        find_sources([Path("clips"), Path(clip)])


def test_a_folder_that_cannot_be_read_is_named(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scan = os.scandir

    def deny(path: str) -> object:
        if Path(path).name == "day1":
            raise PermissionError(13, "Permission denied", str(path))
        return scan(path)

    monkeypatch.setattr("os.scandir", deny)
    with pytest.raises(BatchError, match=r"day1: cannot be read: Permission denied; remove it$"):
        find_sources([folder / "clips"])
