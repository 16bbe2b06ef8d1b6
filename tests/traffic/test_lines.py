"""Crossings of a line: each of the ways in which other counters go wrong."""

import random

import pytest

from traffic.scenes import CAR_HEIGHT, HEIGHT, LINE, WIDTH, events, feet, frames, through, ways
from vdet.config.scene import LineSettings

ABOVE, BELOW = (600.0, 385.0), (600.0, 415.0)  # a quarter of a box from the line


def line(start: tuple[float, float], end: tuple[float, float]) -> LineSettings:
    return LineSettings(name="line", start=start, end=end, left="left", right="right")


class TestDirections:
    def test_right_and_left_are_those_of_someone_who_looks_from_start_to_end(self) -> None:
        down = frames(through((0, 600, 300), (4, 600, 500)))
        up = frames(through((0, 600, 500), (4, 600, 300)))
        assert ways(events(down)) == ["here"]
        assert ways(events(up)) == ["away"]

    def test_an_event_says_when_where_and_who(self) -> None:
        (event,) = events(frames(through((0, 600, 300), (4, 600, 501))))
        assert event.time == pytest.approx(4 * 100 / 201, abs=0.005)
        assert (event.frame, event.name, event.id) == (50, "line", 1)
        assert (event.score, event.vehicle, event.seconds) == (0.9, 1, None)


class TestFlicker:
    def test_one_frame_on_the_other_side_is_nothing(self) -> None:
        for place in (BELOW, (600.0, 400.0 + 3 * CAR_HEIGHT)):
            assert events(feet(*[ABOVE] * 20, place, *[ABOVE] * 20)) == ()

    def test_trembling_on_the_line_for_a_hundred_frames(self) -> None:
        rng = random.Random(0)
        trembling = [(600 + rng.uniform(-1, 1), 400 + rng.uniform(-1, 1)) for _ in range(100)]
        steps = [(600.0, 340.0 + 3 * n) for n in range(20)]
        assert events(feet(*steps, *trembling)) == ()
        goes_on = [(600.0, 401.0 + 3 * n) for n in range(20)]
        assert ways(events(feet(*steps, *trembling, *goes_on))) == ["here"]
        assert events(feet(*steps, *trembling, *reversed(steps))) == ()

    def test_rocking_over_the_line_counts_once(self) -> None:
        """It moves back and forth over the dead band, as in a queue, and then drives on."""
        rocking = [ABOVE] * 10 + [BELOW] * 10
        onward = [(600.0, 415.0 + 3 * n) for n in range(40)]
        assert ways(events(feet(*rocking * 8, *onward))) == ["here"]


def test_a_turn_on_a_wide_road_counts_both_ways_at_once() -> None:
    path = through((0, 400, 380), (3, 400, 430), (6, 700, 430), (8, 700, 375))
    assert ways(events(frames(path))) == ["here", "away"]


class TestEnds:
    @pytest.mark.parametrize(("x", "count"), [(199, 0), (200, 1), (201, 1), (1000, 1), (1001, 0)])
    def test_the_ends_belong_to_the_line_and_a_pixel_beyond_does_not(
        self, x: float, count: int
    ) -> None:
        assert len(events(frames(through((0, x, 300), (4, x, 500))))) == count

    def test_a_line_that_ends_at_the_edge_goes_on_beyond_it(self) -> None:
        """The whole box of a vehicle that leaves at the side stands outside the frame."""
        to_the_edge = line((800, 400), (WIDTH - 1, 400))
        path = through((0, 1100, 300), (2, WIDTH + 40, 440))
        assert ways(events(frames(path), to_the_edge)) == ["right"]

    def test_a_line_in_a_small_frame_stays_a_line(self) -> None:
        assert events(feet((1, 1), (2, 2)), line((0, 0), (0, 8)), size=(128, 72)) == ()


@pytest.mark.parametrize("rate", [10, 25, 30, 60])
@pytest.mark.parametrize("stride", [1, 2, 5])
@pytest.mark.parametrize("scale", [1, 0.5])
def test_rate_stride_and_scale_do_not_change_the_counts(
    rate: int, stride: int, scale: float
) -> None:
    paths = [
        through((0, 300, 300), (8, 320, 520)),
        through((0, 700, 560), (7, 640, 310)),
        through((1, 500, 330), (4, 500, 470), (5, 500, 470), (9, 520, 300)),
        through((2, 900, 380), (9, 900, 395)),
    ]
    video = list(frames(*paths, rate=rate, scale=scale))[::stride]
    found = events(video, LINE, size=(round(scale * WIDTH), round(scale * HEIGHT)))
    assert sorted((event.id, event.direction) for event in found) == [
        (1, "here"), (2, "away"), (3, "away"), (3, "here"),
    ]  # fmt: skip
    expected = {1: 8 * 100 / 220, 2: 7 * 160 / 250}
    for event in found:
        if event.id in expected:
            assert event.time == pytest.approx(expected[event.id], abs=0.05)
