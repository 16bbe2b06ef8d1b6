from pathlib import Path

import pytest

from vdet.errors import OutputError, VideoError
from vdet.files import check_output, replacing


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_the_file_appears_only_when_the_block_ends_well(tmp_path: Path) -> None:
    with replacing(tmp_path / "out.txt") as temporary:
        temporary.write_text("whole")
        assert not (tmp_path / "out.txt").exists()
    assert (tmp_path / "out.txt").read_text() == "whole"
    assert names(tmp_path) == ["out.txt"]


def test_the_temporary_file_lies_beside_and_keeps_the_suffix(tmp_path: Path) -> None:
    with replacing(tmp_path / "out.mp4") as temporary:
        assert temporary.parent == tmp_path
        assert temporary.suffix == ".mp4"


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, SystemExit])
def test_an_error_leaves_nothing_behind(tmp_path: Path, error: type[BaseException]) -> None:
    def write() -> None:
        with replacing(tmp_path / "out.txt") as temporary:
            temporary.write_text("half")
            raise error

    with pytest.raises(error):
        write()
    assert names(tmp_path) == []


def test_an_error_leaves_the_older_file_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "out.txt"
    path.write_text("older")

    def write() -> None:
        with replacing(path) as temporary:
            temporary.write_text("half")
            raise ValueError

    with pytest.raises(ValueError):  # noqa: PT011
        write()
    assert path.read_text() == "older"
    assert names(tmp_path) == ["out.txt"]


def test_a_complete_file_replaces_the_older_one(tmp_path: Path) -> None:
    path = tmp_path / "out.txt"
    path.write_text("older")
    with replacing(path) as temporary:
        temporary.write_text("newer")
    assert path.read_text() == "newer"


def test_a_full_disk_names_the_output(tmp_path: Path) -> None:
    def write() -> None:
        with replacing(tmp_path / "out.txt"):
            raise OSError(28, "No space left on device")

    with pytest.raises(OutputError, match=r"out\.txt: cannot be written: No space left on device"):
        write()
    assert names(tmp_path) == []


def test_an_error_that_says_what_to_do_passes_unchanged(tmp_path: Path) -> None:
    def write() -> None:
        with replacing(tmp_path / "out.mp4"):
            raise VideoError("in.mp4: is cut off")

    with pytest.raises(VideoError, match=r"^in\.mp4: is cut off$"):
        write()


def test_a_missing_folder_is_an_output_error(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot be written"), replacing(tmp_path / "no" / "out"):
        pass


def test_a_folder_of_that_name_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    with pytest.raises(OutputError, match="cannot be written"), replacing(tmp_path / "out"):
        pass
    assert names(tmp_path) == ["out"]


def test_an_output_that_is_there_is_refused_without_overwrite(tmp_path: Path) -> None:
    path = tmp_path / "out.txt"
    path.touch()
    with pytest.raises(OutputError, match="give --overwrite"):
        check_output(path, overwrite=False)
    check_output(path, overwrite=True)


def test_a_new_output_is_fine_and_is_not_made_yet(tmp_path: Path) -> None:
    check_output(tmp_path / "out.txt", overwrite=False)
    assert names(tmp_path) == []


@pytest.mark.parametrize("overwrite", [True, False])
def test_a_folder_is_no_output_file(tmp_path: Path, overwrite: bool) -> None:
    with pytest.raises(OutputError, match="is a folder; give the name of a file"):
        check_output(tmp_path, overwrite=overwrite)


def test_an_output_in_a_missing_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="does not exist; make it first"):
        check_output(tmp_path / "no" / "out.txt", overwrite=True)


def test_a_missing_folder_that_the_work_makes_must_have_one_above_it(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    check_output(tmp_path / "a" / "b" / "out.txt", overwrite=False, makes_folder=True)
    with pytest.raises(OutputError, match="file is no folder"):
        check_output(tmp_path / "file" / "b" / "out.txt", overwrite=False, makes_folder=True)
    assert names(tmp_path) == ["file"]


def test_an_output_below_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="file is no folder"):
        check_output(tmp_path / "file" / "out.txt", overwrite=True)
