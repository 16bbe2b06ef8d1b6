from pathlib import Path

from vdet.evaluate.labelled_video import LabelledVideo
from vdet.evaluate.rows import Row, collect


def video(frame_count: int | None = None) -> LabelledVideo:
    rows = [Row(0, frame, id_, 10 * id_, 0, 5, 5) for frame in (2, 3, 5) for id_ in (1, 2)]
    return collect(Path("scene"), rows, frame_count=frame_count, rate=25)


def test_a_frame_is_its_rows() -> None:
    frame = video().frame(3)
    assert frame.ids.tolist() == [1, 2]
    assert frame.boxes.tolist() == [[10, 0, 5, 5], [20, 0, 5, 5]]


def test_a_frame_without_rows_is_empty() -> None:
    assert [len(video().frame(number)) for number in (0, 1, 4, 6)] == [0, 0, 0, 0]


def test_the_last_frame_is_that_of_the_video_where_known_else_of_the_rows() -> None:
    assert video().last_frame == 5
    assert video(frame_count=9).last_frame == 9
    assert collect(Path("scene"), []).last_frame == 0


def test_until_keeps_the_frames_up_to_and_with_the_last() -> None:
    part = video(frame_count=9).until(3)
    assert part.frames.tolist() == [2, 2, 3, 3]
    assert part.last_frame == 3
    assert part.rate == 25


def test_where_keeps_every_column_of_the_chosen_rows() -> None:
    whole = video()
    second = whole.where(whole.ids == 2)
    assert second.frames.tolist() == [2, 3, 5]
    assert second.boxes[:, 0].tolist() == [20, 20, 20]
    assert len(second.scores) == len(second.ignored) == 3
