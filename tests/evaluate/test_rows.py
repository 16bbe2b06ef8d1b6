from pathlib import Path

import pytest

from vdet.errors import TruthError
from vdet.evaluate.rows import NO_ID, Row, collect

FILE = Path("gt.txt")


def test_rows_are_put_in_order_of_frame_and_stay_in_their_order_within_one() -> None:
    rows = [Row(1, 2, 5, 0, 0, 1, 1), Row(2, 1, 9, 0, 0, 1, 1), Row(3, 1, 4, 0, 0, 1, 1)]
    video = collect(FILE, rows)
    assert video.frames.tolist() == [1, 1, 2]
    assert video.ids.tolist() == [9, 4, 5]


def test_no_rows_make_a_video_without_boxes() -> None:
    video = collect(FILE, [])
    assert len(video) == 0
    assert video.boxes.shape == (0, 4)


@pytest.mark.parametrize(
    ("row", "message"),
    [
        (Row(7, 0, 1, 0, 0, 5, 5), "gt.txt:7: the frame comes before the video's first"),
        (Row(7, 11, 1, 0, 0, 5, 5), "gt.txt:7: the frame is number 11 of a video of 10"),
        (Row(7, 1, -1, 0, 0, 5, 5), "gt.txt:7: id -1 is negative"),
        (Row(7, 1, -2, 0, 0, 5, 5, ignored=True), "gt.txt:7: id -2 is negative"),
        (Row(7, 1, 1, 0, 0, 0, 5), "gt.txt:7: the box has no area: 0 wide, 5 high"),
        (Row(7, 1, 1, 0, 0, -5, -5), "gt.txt:7: the box has no area: -5 wide, -5 high"),
        (Row(7, 1, 1, 0, 0, 1e-200, 1e-200), "gt.txt:7: the box has no area"),
    ],
)
def test_an_impossible_row_is_refused_by_its_line(row: Row, message: str) -> None:
    with pytest.raises(TruthError) as caught:
        collect(FILE, [row], frame_count=10)
    assert str(caught.value).startswith(message)


def test_an_id_twice_in_a_frame_is_refused_with_both_lines() -> None:
    rows = [Row(1, 1, 3, 0, 0, 5, 5), Row(2, 2, 3, 0, 0, 5, 5), Row(3, 1, 3, 9, 9, 5, 5)]
    with pytest.raises(
        TruthError, match=r"gt\.txt:3: id 3 is in the same frame already \(line 1\)"
    ):
        collect(FILE, rows)


def test_ignore_regions_without_an_id_may_be_many_in_a_frame() -> None:
    rows = [Row(line, 1, NO_ID, 0, 0, 5, 5, ignored=True) for line in (1, 2, 3)]
    assert collect(FILE, rows).ignored.tolist() == [True] * 3


def test_the_last_frame_of_the_video_is_not_beyond_it() -> None:
    assert collect(FILE, [Row(1, 10, 1, 0, 0, 5, 5)], frame_count=10).last_frame == 10
