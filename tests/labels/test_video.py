from pathlib import Path

import pytest

from labels.saving import checked_video, row
from vdet.errors import TruthError
from vdet.labels.label import NO_ID, Label, LabelledVideo


def scene(frame_count: int | None = None) -> LabelledVideo:
    rows = [row(0, frame, id_, 10 * id_, 0, 5, 5) for frame in (2, 3, 5) for id_ in (1, 2)]
    return checked_video(rows, Path("scene"), frame_count=frame_count, rate=25)


def test_until_keeps_the_frames_up_to_the_last() -> None:
    part = scene(frame_count=9).until(3)
    assert part.frames.tolist() == [2, 2, 3, 3]
    assert part.last_frame == 3
    assert part.rate == 25


FILE = Path("gt.txt")


@pytest.mark.parametrize(
    ("row", "message"),
    [
        (row(7, 0, 1, 0, 0, 5, 5), "gt.txt:7: the frame comes before the video's first"),
        (row(7, 1, -1, 0, 0, 5, 5), "gt.txt:7: id -1 is negative"),
        (row(7, 1, -2, 0, 0, 5, 5, ignored=True), "gt.txt:7: id -2 is negative"),
        (row(7, 1, 1, 0, 0, 0, 5), "gt.txt:7: the box has no area: 0 wide, 5 high"),
        (row(7, 1, 1, 0, 0, -5, -5), "gt.txt:7: the box has no area: -5 wide, -5 high"),
        (row(7, 1, 1, 0, 0, 1e-200, 1e-200), "gt.txt:7: the box has no area"),
    ],
)
def test_an_impossible_row_is_refused_with_its_line(row: Label, message: str) -> None:
    with pytest.raises(TruthError) as caught:
        checked_video([row], FILE)
    assert str(caught.value).startswith(message)


def test_an_id_twice_in_a_frame_is_refused_with_its_line() -> None:
    rows = [row(1, 1, 3, 0, 0, 5, 5), row(2, 2, 3, 0, 0, 5, 5), row(3, 1, 3, 9, 9, 5, 5)]
    with pytest.raises(TruthError, match=r"gt\.txt:3: id 3 occurs twice in the same frame"):
        checked_video(rows, FILE)


def test_a_frame_may_have_many_ignore_regions_without_an_id() -> None:
    rows = [row(line, 1, NO_ID, 0, 0, 5, 5, ignored=True) for line in (1, 2, 3)]
    assert checked_video(rows, FILE).ignored.tolist() == [True] * 3
