"""Lines that are proposed: each stream gets one in and one out, away from its ends."""

import pytest

from traffic.scenes import HEIGHT, WIDTH, Path, frames, settings_for, through
from vdet.config.places import LineSettings
from vdet.polygons import side_of
from vdet.track.track import FrameTracks
from vdet.traffic.counting import count_frames
from vdet.traffic.records import VehicleRecords
from vdet.traffic.suggestions import SuggestedLine, suggest_lines

DOWN = [through((0.5 * n, 400 + 30 * n, 100), (4 + 0.5 * n, 380 + 40 * n, 700)) for n in range(4)]
TO_THE_RIGHT = [through((n, 20, 300), (5 + n, 1260, 320)) for n in range(3)]


def suggested(video: list[FrameTracks]) -> tuple[SuggestedLine, ...]:
    records = VehicleRecords(WIDTH)
    for frame in video:
        records.add(frame)
    return suggest_lines(records.end(), WIDTH, HEIGHT)


def test_a_stream_gets_a_line_in_and_a_line_out_that_all_its_vehicles_cross() -> None:
    video = list(frames(*DOWN))
    first, last = suggested(video)
    assert [(each.name, each.vehicles, each.way) for each in (first, last)] == [
        ("in 1", 4, "down"), ("out 1", 4, "down"),
    ]  # fmt: skip
    assert first.start[1] < last.start[1]
    lines = (LineSettings(name=e.name, start=e.start, end=e.end) for e in (first, last))
    counts = count_frames(video, settings_for(*lines))
    assert [(total.name, total.direction, total.count) for total in counts.totals] == [
        ("in 1", "left", 4), ("in 1", "right", 0), ("out 1", "left", 4), ("out 1", "right", 0),
    ]  # fmt: skip


def test_streams_that_cross_have_lines_of_their_own_the_busiest_first() -> None:
    lines = suggested(list(frames(*DOWN, *TO_THE_RIGHT)))
    assert [(each.name, each.vehicles, each.way) for each in lines] == [
        ("in 1", 4, "down"), ("in 2", 3, "right"), ("out 1", 4, "down"), ("out 2", 3, "right"),
    ]  # fmt: skip


def test_the_stream_crosses_to_the_left_of_its_lines() -> None:
    for line in suggested(list(frames(*DOWN))):
        assert side_of(line.start, line.end, (450, 700)) < side_of(line.start, line.end, (450, 100))


def test_lines_lie_in_the_frame() -> None:
    at_the_edge = [through((0, 5, 700), (4, 5, 20)), through((0, 1275, 20), (4, 1275, 700))]
    lines = suggested(list(frames(*at_the_edge)))
    assert len(lines) == 4
    for x, y in (point for line in lines for point in (line.start, line.end)):
        assert 0 <= x <= WIDTH
        assert 0 <= y <= HEIGHT


@pytest.mark.parametrize("paths", [[], [through((0, 400, 400), (5, 410, 400))]])
def test_vehicles_that_do_not_move_get_no_line(paths: list[Path]) -> None:
    assert suggested(list(frames(*paths))) == ()
