from pathlib import Path

import pytest

from vdet.errors import TruthError
from vdet.evaluate.labelled_video import Row
from vdet.evaluate.mot import result_rows, truth_rows

FILE = Path("gt.txt")


def test_pixels_count_from_1_in_the_file_and_from_0_in_memory() -> None:
    assert list(truth_rows(FILE, "1,7,1,1,20,10,1,3,1")) == [Row(1, 1, 7, 0, 0, 20, 10)]


def test_flag_0_marks_an_ignore_region() -> None:
    text = "1,7,1,1,20,10,0,3,1\n1,8,1,1,20,10,1,3,1\n"
    assert [row.ignored for row in truth_rows(FILE, text)] == [True, False]


def test_the_older_form_with_ten_columns_is_read_too() -> None:
    assert list(truth_rows(FILE, "4, 7, 11.5, 21, 20, 10, 1, -1, -1, -1")) == [
        Row(1, 4, 7, 10.5, 20, 20, 10)
    ]


def test_tracks_have_a_confidence() -> None:
    (row,) = result_rows(FILE, "3,1,11,21,30,40,0.5,-1,-1,-1")
    assert (row.score, row.frame, row.x, row.y) == (0.5, 3, 10, 20)


@pytest.mark.parametrize(
    ("second", "message"),
    [
        ("2,7,1,1,20,10,1,3", "MOTChallenge has 9 columns between commas; this line has 8"),
        ("2,7,1,1,20,10,1,3,1,1", "MOTChallenge has 9 columns between commas; this line has 10"),
        (
            "1 0 Car 0 0 0 1 1 9 9 1 1 1 1 1 1 1",
            "MOTChallenge has 9 columns between commas; this line has 1",
        ),
        ("2,7,1,1,20,wide,1,3,1", "'wide' is not a number"),
        ("2,7,nan,1,20,10,1,3,1", "'nan' is not a number"),
        ("2.5,7,1,1,20,10,1,3,1", "'2.5' is not a whole number"),
        ("2,7,1,1,20,10,0.9,3,1", "the flag (column 7) is 0.9; it must be 0 or 1"),
        ("2,7,1,1,20,10,1,Car,1", "'Car' is not a number"),
    ],
)
def test_a_wrong_line_is_refused_with_its_number(second: str, message: str) -> None:
    with pytest.raises(TruthError) as caught:
        list(truth_rows(FILE, f"1,7,1,1,20,10,1,3,1\n\n{second}\n"))
    assert str(caught.value).startswith(f"gt.txt:3: {message}")


def test_tracks_have_ten_columns() -> None:
    with pytest.raises(
        TruthError, match="MOTChallenge has 10 columns between commas; this line has 9"
    ):
        list(result_rows(FILE, "1,7,1,1,20,10,1,3,1"))
