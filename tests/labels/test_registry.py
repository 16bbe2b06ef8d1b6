from pathlib import Path

import pytest

from labels.saving import car, frame, written
from vdet.errors import OutputError, TruthError
from vdet.labels.coco import COCO
from vdet.labels.formats import (
    Format,
    check_track_name,
    format_for,
    track_formats,
    track_suffixes,
)
from vdet.labels.lines import MOT
from vdet.labels.reading import read_tracks


def test_every_format_has_an_ending_of_its_own() -> None:
    suffixes = track_suffixes()
    assert [format_for(Path(f"a.b{suffix.upper()}")) for suffix in suffixes] == track_formats()


@pytest.mark.parametrize(
    ("name", "form"),
    [
        ("gt.txt", MOT),
        ("gt", MOT),
        ("gt.csv", MOT),
        ("instances_default.json", COCO),
    ],
)
def test_the_content_tells_the_format_where_the_name_leaves_it_open(
    tmp_path: Path, name: str, form: Format
) -> None:
    path = tmp_path / name
    path.write_bytes(written(form, [frame(2, car(5))]))
    ((index, (row,)),) = read_tracks(path).frames.items()
    assert (index, row.id) == (2, 5)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("gt.txt", "1;1;10;20;30;40", "are separated by semicolons; they must be separated by c"),
        ("gt.csv", "frame\ttime\tid", "are separated by tabs; they must be separated by commas"),
        ("gt.txt", "1 2 3", "MOTChallenge has 9 or 10 columns; this line has"),
        ("a.json", "{}", "is not COCO: images: Field required"),
        ("0000.txt", "0 3 Car 0 2 -1.57", "KITTI tracks are no longer read"),
        ("t.xml", "<annotations>", r"t\.xml: XML is not supported; export the labels as COCO"),
    ],
)
def test_what_other_tools_write_is_refused_in_words_that_fit(
    tmp_path: Path, name: str, content: str, message: str
) -> None:
    (tmp_path / name).write_text(content)
    with pytest.raises(TruthError, match=message):
        read_tracks(tmp_path / name)


def test_tracks_are_not_written_under_the_name_of_a_format_that_is_gone() -> None:
    with pytest.raises(OutputError, match=r"use \.txt or \.coco\.json"):
        check_track_name(Path("a.kitti.txt"))


def test_an_empty_file_of_another_name_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.json").touch()
    with pytest.raises(TruthError, match=r"a\.json: is empty; tracks and ground truth must be"):
        read_tracks(tmp_path / "a.json")
