"""Temporary files: in use, or forsaken by a process that has ended."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from vdet.files import remove_stale, replacing, temporary_beside

LEAVE_ONE = """
import os, sys
from pathlib import Path
from vdet.files import temporary_beside

with temporary_beside(Path(sys.argv[1])):
    os._exit(1)
"""


def leave_one(path: Path) -> Path:
    """Let a process end in the middle of writing `path`."""
    subprocess.run([sys.executable, "-c", LEAVE_ONE, str(path)], check=False)
    (left,) = path.parent.glob(f".{path.stem}.vdet-*{path.suffix}")
    return left


def test_what_an_ended_process_left_is_removed(tmp_path: Path) -> None:
    left = leave_one(tmp_path / "out.mp4")
    remove_stale(tmp_path)
    assert not left.exists()


def test_what_is_in_use_is_kept(tmp_path: Path) -> None:
    with temporary_beside(tmp_path / "out.mp4") as temporary:
        remove_stale(tmp_path)
        assert temporary.exists()
        with replacing(tmp_path / "out.mp4"), replacing(tmp_path / "other.txt"):
            assert temporary.exists()


def test_writing_anything_in_a_folder_cleans_it(tmp_path: Path) -> None:
    leave_one(tmp_path / "a.csv")
    with replacing(tmp_path / "b.mp4"):
        pass
    assert [path.name for path in tmp_path.iterdir()] == ["b.mp4"]


@pytest.mark.parametrize(
    "name", [".out.1a2b3c4d.mp4", "out.vdet-1a2b3c4d.mp4", ".vdet-1a2b3c4d", ".a.vdet-1a2b3c4x.mp4"]
)
def test_files_of_others_are_never_removed(tmp_path: Path, name: str) -> None:
    (tmp_path / name).touch()
    remove_stale(tmp_path)
    assert (tmp_path / name).exists()


def test_a_link_of_such_a_name_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "precious").touch()
    (tmp_path / ".a.vdet-1a2b3c4d.mp4").symlink_to("precious")
    remove_stale(tmp_path)
    assert (tmp_path / "precious").exists()


def test_a_folder_that_is_not_there_needs_no_cleaning(tmp_path: Path) -> None:
    remove_stale(tmp_path / "none")


@pytest.mark.parametrize("stem", ["x" * 250, "ü" * 125, "\udcff" * 250])
def test_a_name_of_any_length_has_room_for_the_mark(tmp_path: Path, stem: str) -> None:
    path = tmp_path / f"{stem}.mp4"
    with replacing(path) as temporary:
        temporary.write_text("whole")
    assert path.read_text() == "whole"


def test_where_files_have_no_locks_nothing_is_forsaken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(38, "Function not implemented")

    monkeypatch.setattr("fcntl.flock", refuse)
    with temporary_beside(tmp_path / "a.mp4") as temporary:
        remove_stale(tmp_path)
        assert temporary.exists()
    assert list(tmp_path.iterdir()) == []


def test_one_that_is_removed_between_its_making_and_its_lock_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[Path] = []
    fstat = os.fstat

    def remove_the_first(descriptor: int) -> os.stat_result:
        if not made:
            made.extend(tmp_path.iterdir())
            made[0].unlink()
        return fstat(descriptor)

    monkeypatch.setattr("os.fstat", remove_the_first)
    with temporary_beside(tmp_path / "a.mp4") as temporary:
        assert temporary.exists()
        assert [temporary] != made
