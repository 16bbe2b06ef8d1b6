"""Labels, and the texts and numbers that they are read from."""

import math
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from labels.saving import Row, checked_video, row, video_of
from vdet.errors import TruthError
from vdet.labels.label import NO_ID, SavedTracks, SourceVideo, numbered_lines


def test_until_keeps_the_frames_up_to_the_last() -> None:
    rows = [row(0, frame, id_, 10 * id_, 0, 5, 5) for frame in (1, 2, 4) for id_ in (1, 2)]
    part = checked_video(rows).until(3)
    assert {index: len(tracks) for index, tracks in part.frames.items()} == {1: 2, 2: 2}
    assert part.length == 3


NOW = 1_777_618_800.0


@pytest.mark.parametrize(
    ("times", "rate", "expected"),
    [
        ({0: 0.0, 2: 0.08}, None, {0: 0.0, 2: 0.08}),
        ({0: 1.4, 2: 1.48}, None, {0: 0.0, 2: 0.08}),
        ({0: -0.12, 2: -0.04}, None, {0: 0.0, 2: 0.08}),
        ({37: 3601.48, 38: 3601.52}, None, {37: 1.48, 38: 1.52}),
        ({10: NOW + 1, 12: NOW + 1.2}, 10.0, {10: 1.0, 12: 1.2}),
        ({1500: 63.0, 1501: 63.04}, None, {1500: 63.0, 1501: 63.04}),  # the rate varies
        ({25: 1.0}, 25.0, {25: 1.0}),
    ],
)
def test_times_count_from_the_first_frame_of_the_video(
    times: dict[int, float], rate: float | None, expected: dict[int, float]
) -> None:
    begin = datetime(2026, 5, 1, 7, tzinfo=UTC)
    saved = SavedTracks({}, times=times, begin=begin, video=SourceVideo("a.ts", 9, 9, rate=rate))
    counted = saved.from_first_frame()
    assert counted.times == pytest.approx(expected, abs=1e-5)
    assert counted.begin is not None
    moments = [
        [(tracks.begin + timedelta(seconds=time)).timestamp() for time in tracks.times.values()]
        for tracks in (saved, counted)
        if tracks.begin
    ]
    assert moments[0] == pytest.approx(moments[1]), "the clock times are the same"


FILE = Path("gt.txt")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (row(7, -1, 1, 0, 0, 5, 5), "the frame comes before the video's first"),
        (row(7, 1, -1, 0, 0, 5, 5), "id -1 is negative"),
        (row(7, 1, -2, 0, 0, 5, 5, ignored=True), "id -2 is negative"),
        (row(7, 1, 3, 9, 9, 5, 5), "id 3 occurs twice in the same frame"),
        (row(7, 1, 1, 0, 0, 0, 5), "the box has no area: 0 wide, 5 high"),
        (row(7, 1, 1, 0, 0, -5, -5), "the box has no area: -5 wide, -5 high"),
        (row(7, 1, 1, 0, 0, 1e-200, 1e-200), "the box has no area"),
    ],
)
def test_an_impossible_row_is_refused_with_its_line(wrong: Row, message: str) -> None:
    rows = [row(1, 1, 3, 0, 0, 5, 5), row(2, 2, 3, 0, 0, 5, 5), wrong]
    with pytest.raises(TruthError) as caught:
        checked_video(rows, FILE)
    assert str(caught.value).startswith(f"gt.txt:7: {message}")


def test_a_frame_may_have_many_ignore_regions_without_an_id() -> None:
    rows = [row(line, 1, NO_ID, 0, 0, 5, 5, ignored=True) for line in (1, 2, 3)]
    assert len(checked_video(rows, FILE).frames[1]) == 3


def test_words_for_a_class_become_ours_and_others_stay() -> None:
    labels = ("Van", "lorry", "tractor", None)
    rows = [row(1, 0, number, 0, 0, 9, 9, name=label) for number, label in enumerate(labels)]
    names = [track.class_name for track in next(iter(video_of(rows))).tracks]
    assert names == ["car", "truck", "tractor", None]


def test_a_rate_gives_times_to_frames_without() -> None:
    saved = video_of((row(1, 5, 1, 0, 0, 9, 9), row(1, 6, 1, 0, 0, 9, 9)), times={6: 0.5})
    assert not saved.has_times
    assert math.isnan(next(iter(saved)).time)
    timed = saved.at_rate(10)
    assert timed.has_times
    assert [frame.time for frame in timed] == [0.5, 0.5]


def test_frames_ascend_where_a_set_of_their_numbers_does_not() -> None:
    assert [frame.index for frame in SavedTracks({}, (7, 8))] == [7, 8]


def test_blank_lines_count() -> None:
    assert list(numbered_lines(Path("a"), b"a\r\n\r\n b \nc")) == [(1, "a"), (3, "b"), (4, "c")]


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", bytes(range(256))])
def test_a_file_that_is_not_text_is_refused(content: bytes) -> None:
    with pytest.raises(TruthError, match="gt: is not a text file"):
        list(numbered_lines(Path("gt"), content))


def test_a_byte_order_mark_is_not_part_of_the_text() -> None:
    assert list(numbered_lines(Path("gt"), b"\xef\xbb\xbf1,2")) == [(1, "1,2")]
