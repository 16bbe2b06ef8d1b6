"""Lines that are proposed: one across each stream that has enough vehicles."""

from collections.abc import Sequence

import pytest

from traffic.scenes import HEIGHT, WIDTH, Path, frames, settings_for, through
from vdet.config.shapes import LineSettings
from vdet.polygons import meeting
from vdet.traffic.counting import count_frames
from vdet.traffic.linking import link_tracks
from vdet.traffic.proposals import ProposedLine, propose_lines

DOWN = [through((0.5 * n, 400 + 30 * n, 100), (4 + 0.5 * n, 380 + 40 * n, 700)) for n in range(6)]
UP = [through((0.5 * n, 800 + 30 * n, 700), (4 + 0.5 * n, 790 + 20 * n, 80)) for n in range(5)]
RIGHT = [through((n, 20, 200), (5 + n, 1260, 220 + 5 * n)) for n in range(5)]


def proposed(*paths: Path, facing: str | None = None) -> tuple[ProposedLine, ...]:
    linked = link_tracks(frames(*paths, seconds=14), WIDTH, HEIGHT)
    return propose_lines(linked, WIDTH, HEIGHT, facing)


def counted(lines: Sequence[ProposedLine], *paths: Path) -> dict[tuple[str, str], int]:
    """Return the counts that are not 0."""
    settings = settings_for(
        *(
            LineSettings(name=e.name, start=e.start, end=e.end, left=e.left, right=e.right)
            for e in lines
        )
    )
    totals = count_frames(frames(*paths, seconds=14), settings, (WIDTH, HEIGHT)).totals
    return {(total.name, total.direction): total.count for total in totals if total.count}


def test_each_stream_has_a_line_of_its_own_that_is_named_by_its_direction() -> None:
    lines = proposed(*DOWN, *UP)
    assert [(line.name, line.left, line.right, line.vehicles) for line in lines] == [
        ("down", "down", "up", 6), ("up", "up", "down", 5),
    ]  # fmt: skip
    assert counted(lines, *DOWN, *UP) == {("down", "down"): 6, ("up", "up"): 5}


def test_with_the_camera_s_direction_lines_are_named_by_the_compass() -> None:
    for facing, names in {
        "N": ("southbound", "northbound"),
        "SE": ("northwestbound", "southeastbound"),
    }.items():
        [line] = proposed(*DOWN, facing=facing)
        assert (line.left, line.right) == names


def test_lines_lie_in_the_frame_and_do_not_cross_each_other() -> None:
    lines = proposed(*DOWN, *UP, *RIGHT)
    assert sorted(line.name for line in lines) == ["down", "right", "up"]
    ends = [(line.start, line.end) for line in lines]
    assert all(meeting(one, other) is None for one in ends for other in ends if one != other)
    assert all(0 <= x <= WIDTH and 0 <= y <= HEIGHT for end in ends for x, y in end)


def test_a_road_beside_another_has_its_own_line() -> None:
    beside = [through((n, 1000 + 10 * n, 80), (4 + n, 1040 + 20 * n, 700)) for n in range(5)]
    lines = proposed(*DOWN, *beside)
    assert [(line.name, line.vehicles) for line in lines] == [("down", 6), ("down 2", 5)]


@pytest.mark.parametrize(
    "paths", [[], DOWN[:4], [through((0, 400, 100 * n), (5, 410, 100 * n)) for n in range(6)]]
)
def test_few_vehicles_and_those_that_stand_get_no_line(paths: list[Path]) -> None:
    assert proposed(*paths) == ()
