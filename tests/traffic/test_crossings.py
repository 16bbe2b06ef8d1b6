"""Paths, and crossings as a function of them: asking changes nothing."""

from collections.abc import Iterator

import pytest

from traffic.scenes import (
    HEIGHT,
    LINE,
    WIDTH,
    ZONE,
    feet,
    frames,
    settings_for,
    through,
)
from vdet.polygons import Point
from vdet.track.track import FrameTracks
from vdet.traffic.counter import VehicleCounter
from vdet.traffic.crossings import (
    Line,
    crossings,
    lines_and_zones,
    link_tracks,
)

SETTINGS = settings_for(LINE, ZONE)
DOWN = through((0, 600, 250), (5, 600, 550))  # in the zone at 0.83 s, on the line at 2.5 s


def test_counts_in_the_middle_of_a_video_change_nothing() -> None:
    asked, silent = (VehicleCounter(SETTINGS, WIDTH, HEIGHT) for _ in range(2))
    gone = through((0, 700, 250), (3, 700, 450), (5, 700, 350), (6, 700, 250), gone=[(3, 4)])
    for frame in frames(DOWN, gone):
        asked.update(frame)
        silent.update(frame)
        asked.counts()
        asked.so_far()
    assert asked.counts() == asked.counts() == silent.counts()
    assert len(silent.counts().events) > 5


def test_the_counts_so_far_have_those_inside_a_zone() -> None:
    counter = VehicleCounter(SETTINGS, WIDTH, HEIGHT)
    inside = []
    for frame in frames(DOWN, through((2, 300, 350), (4, 500, 350))):
        counter.update(frame)
        found = counter.so_far()
        inside.append(found["zone", "enter"] - found["zone", "exit"] - found["zone", "vanish"])
    assert [inside[25 * second] for second in (0, 2, 4, 6)] == [0, 1, 2, 0]
    assert found["line", "here"] == 1


def test_the_counts_so_far_may_be_of_fewer_classes() -> None:
    trucks = SETTINGS.model_copy(update={"classes": ("truck",)})
    counter = VehicleCounter(trucks, WIDTH, HEIGHT, with_all_classes=True)
    for frame in frames(DOWN, through((2, 300, 350), (4, 500, 350))):
        counter.update(frame)
        assert not counter.so_far()
    assert counter.counts().events


def test_a_vehicle_that_stands_for_long_takes_no_memory() -> None:
    def stands() -> Iterator[FrameTracks]:
        drives = [(600.0, 300.0 + 2 * n) for n in range(50)]
        waits = [(600.0 + n % 2, 399.0 - n % 3) for n in range(20_000)]
        yield from feet(*drives, *waits, *((600.0, 400.0 + 2 * n) for n in range(50)))

    (path,) = link_tracks(stands(), WIDTH, HEIGHT)
    assert len(path.times) < 1000
    assert path.seconds == pytest.approx(20_099 / 25)
    line, _ = (item for (item,) in lines_and_zones(SETTINGS.traffic, WIDTH, HEIGHT))
    (event,) = crossings(path, line)
    assert (event.direction, path.frames[event.row]) == ("here", 20_050)


def test_a_vehicle_that_is_exactly_on_an_oblique_line_in_a_frame_crosses_it_once() -> None:
    """Rounding must not put the crossing before or after both neighbours of this frame."""

    def scaled(x: int, y: int) -> Point:
        return x / WIDTH * WIDTH, y / HEIGHT * HEIGHT  # as where points are fractions

    ends = scaled(545, 302), scaled(473, 198)
    line = Line("oblique", ("left", "right"), *ends, (WIDTH, HEIGHT))
    path = feet(*((527 + 8 * k, 276 + 3 * k) for k in range(-15, 16)), height=30)
    (linked,) = link_tracks(path, WIDTH, HEIGHT)
    assert [crossing.row for crossing in crossings(linked, line)] == [15]
