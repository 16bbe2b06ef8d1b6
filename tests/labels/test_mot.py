from dataclasses import astuple
from pathlib import Path

import pytest

from labels.saving import car, frame, written
from vdet.errors import TruthError
from vdet.labels.lines import MOT, read_mot
from vdet.labels.reading import read_tracks, read_truth


def test_truth_of_the_older_form_has_ten_columns_and_a_flag(tmp_path: Path) -> None:
    path = tmp_path / "gt.txt"
    path.write_text("4, 7, 11.5, 21, 20, 10, 1, -1, -1, -1\n4,8,1,1,9,9,0,-1,-1,-1")
    assert [label.ignored for label in read_truth(path).tracks] == [False, True]


def test_truth_with_spaces_is_read_and_several_classes_are_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "gt.txt"
    path.write_text("1 7 11 21 20 10 1 4 0 0\n1 8 1 1 9 9 1 1 0 0\n1 9 1 1 9 9 0 0 0 0\n")
    boxes = [astuple(label.box) for label in read_truth(path).tracks]
    assert boxes == [(10, 20, 30, 30), (0, 0, 9, 9), (0, 0, 9, 9)]
    text = "column 8 has the classes 1, 4, which are all read as vehicles"
    assert caplog.messages == [f"{path}: {text}; keep only the rows of vehicles"]


def test_truth_of_uavdt_has_vehicles_partly_outside_and_a_file_of_ignore_regions(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path, regions = tmp_path / "M01_gt_whole.txt", tmp_path / "M01_gt_ignore.txt"
    path.write_text("1,7,11,21,20,10,2,1,1\n1,8,1,1,9,9,3,1,3\n")
    regions.write_text("1,7,101,1,50,50,1,-1,-1\n")
    found = [(label.id, label.box.x1, label.ignored) for label in read_truth(path).tracks]
    assert found == [(7, 10, False), (8, 0, False), (-1, 100, True)]
    assert caplog.messages == []
    path.write_text("1,7,11,21,20,10,0,-1,-1,-1\n")
    assert all(label.ignored for label in read_truth(path).tracks)
    text = "has no vehicle, only ignore regions; column 7 is 0 in all lines"
    assert caplog.messages == [f"{path}: {text}"]


def test_tracks_are_written_without_a_heading() -> None:
    assert written(MOT, [frame(4, car())]) == b"5,1,11,21,30,40,0.7500,-1,-1,-1\n"


def test_truth_can_be_read_as_tracks_without_its_ignore_regions(tmp_path: Path) -> None:
    path = tmp_path / "gt.txt"
    path.write_text("1,7,1,1,20,10,0,3,1\n1,8,1,1,20,10,1,3,1\n")
    assert [row.id for row in read_tracks(path).tracks] == [8]


@pytest.mark.parametrize(
    ("second", "message"),
    [
        ("2,7,1,1,20,10,1,3,1,1", "MOTChallenge has 9 columns; this line has 10"),
        ("2,7,1,1,20,tall,1,3,1", "height: Input should be a valid number"),
        ("2,7,nan,1,20,10,1,3,1", "left: Input should be a finite number"),
        ("2,7,1e8,1,20,10,1,3,1", "left: Input should be less than or equal to 10000000"),
        ("2.5,7,1,1,20,10,1,3,1", "frame: Input should be a valid integer"),
        (
            "2,7,1,1,20,10,0.9,3,1",
            "with nine columns, column 7 must be a flag, 0 or 1, but is 0.9; a results file",
        ),
    ],
)
def test_a_wrong_line_is_refused_with_its_number(second: str, message: str) -> None:
    with pytest.raises(TruthError) as caught:
        read_mot(Path("gt.txt"), f"1,7,1,1,20,10,1,3,1\n\n{second}\n".encode())
    assert str(caught.value).startswith(f"gt.txt:3: {message}")
