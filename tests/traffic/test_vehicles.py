"""Which vehicles count, with which class, and what becomes of them when their id changes."""

import math

import pytest

from traffic.scenes import (
    HEIGHT,
    LINE,
    WIDTH,
    counts,
    events,
    feet,
    frames,
    joined,
    named,
    numbered,
    through,
    track,
    ways,
)
from vdet.config.scene import LineSettings
from vdet.errors import TruthError
from vdet.track.track import FrameTracks
from vdet.traffic.crossings import link_tracks

DOWN = through((0, 600, 300), (4, 600, 500))


def test_a_vehicle_that_is_seen_for_a_moment_does_not_count() -> None:
    moment = feet((600, 300), (600, 350), (600, 450), (600, 500))
    assert events(moment) == ()
    assert ways(events(moment, min_seen_seconds=0.1)) == ["here"]


def test_once_it_is_confirmed_what_it_did_before_counts() -> None:
    path = [(600.0, 300.0), (600.0, 350.0), (600.0, 470.0), (600.0, 500.0)]
    stays = [(600.0, 505.0)] * 10
    (event,) = events(feet(*path, *stays))
    assert event.frame == 2


def test_one_that_is_lost_just_before_a_line_crosses_it_if_it_drives_on() -> None:
    assert ways(events(frames(through((0, 600, 300), (2, 600, 395))))) == ["here"]
    assert events(frames(through((0, 600, 300), (1, 600, 390), (2, 600, 395)))) == ()
    assert events(frames(through((0, 600, 300), (2, 600, 395)), seconds=2)) == ()  # it may go on


class TestNewIds:
    def test_a_new_id_on_the_line_goes_on_with_the_old_one(self) -> None:
        old = frames(through((0, 600, 300), (1.9, 600, 395)), seconds=2)
        new = numbered(frames(through((2.1, 600, 405), (4, 600, 500))), 2)
        (event,) = events(joined(old, new))
        assert (event.id, event.direction, event.vehicle) == (2, "here", 1)
        assert 1.9 < event.time < 2.1

    def test_a_new_id_elsewhere_or_later_is_another_vehicle(self) -> None:
        old = frames(through((0, 600, 310), (1.9, 600, 385)), seconds=2)
        for new in (
            through((2.1, 800, 405), (4, 800, 500)),
            through((3.5, 600, 405), (6, 600, 500)),
        ):
            assert events(joined(old, numbered(frames(new), 2))) == ()

    def test_one_that_comes_in_where_another_has_just_left_is_another_vehicle(self) -> None:
        out = frames(through((0, 1100, 380), (3, 1260, 440)), seconds=3)
        in_ = numbered(frames(through((3.6, 1255, 425), (8, 1100, 380)), seconds=8), 2)
        edge = LineSettings(name="line", start=(900, 400), end=(1280, 400), left="away", right="in")
        found = events(joined(out, in_), edge)
        assert [(event.id, event.direction) for event in found] == [(1, "in"), (2, "away")]
        assert {event.vehicle for event in found} == {1, 2}

    def test_one_that_would_be_outside_by_now_is_not_the_one_that_comes_in_beside_it(self) -> None:
        out = frames(through((0, 600, 300), (2, 600, 690)), seconds=2)
        in_ = numbered(frames(through((2.3, 640, 690), (4, 640, 300)), seconds=4), 2)
        found = events(joined(out, in_))
        assert [(event.id, event.direction) for event in found] == [(1, "here"), (2, "away")]
        assert {event.vehicle for event in found} == {1, 2}

    def test_a_track_that_comes_back_the_other_way_is_another_vehicle(self) -> None:
        lost = [(2.0, 3.0)]
        turned = through((0, 600, 300), (2, 600, 500), (3, 620, 510), (6, 620, 300), gone=lost)
        same = through((0, 600, 300), (2, 600, 380), (3, 600, 420), (6, 600, 520), gone=lost)
        assert [(e.direction, e.vehicle) for e in events(frames(turned))] == [
            ("here", 1),
            ("away", 2),
        ]
        bends = through((0, 400, 380), (2, 600, 380), (3, 620, 390), (4, 590, 430), gone=lost)
        for path in (same, bends):
            assert [(e.direction, e.vehicle) for e in events(frames(path))] == [("here", 1)]

    def test_stop_and_go_with_a_new_id_every_second(self) -> None:
        """A queue that rocks on the line while the tracker gives it new ids, and then moves on."""
        video = []
        for index in range(20 * 25):
            rocks = 397 + 6 * (index // 30 % 2)
            y = 320 + 2 * index if index < 38 else rocks if index < 420 else 403 + 3 * (index - 420)
            video += [FrameTracks(index, index / 25, (track((600, y), 1 + index // 25),))]
        assert ways(events(video)) == ["here"]


@pytest.mark.parametrize("times", [(0.0, math.nan), (0.0, math.inf), (1.0, 0.5)])
def test_times_that_no_video_has_are_refused(times: tuple[float, float]) -> None:
    video = [FrameTracks(n, time, (track((600, 300)),)) for n, time in enumerate(times)]
    with pytest.raises(TruthError, match=r"frame \d: .* s is before .* s; times must increase"):
        counts(video, LineSettings(name="line", start=(0, 450), end=(1280, 450)))


def test_a_class_that_flips_on_the_line_does_not_split_the_history() -> None:
    cars, trucks = (named(frames(DOWN), name) for name in ("car", "truck"))
    (event,) = events([*cars[:45], *trucks[45:55], *cars[55:]])
    assert event.class_name == "car"


@pytest.mark.parametrize(
    ("last", "first"),
    [
        ((5, 1250, 300), (5.04, 30, 500)),  # leaves at the right, the next comes from the left
        ((5, 1250, 300), (9, 30, 500)),
        ((5, 600, 300), (5.04, 200, 500)),  # in the middle of the frame
        ((5, 600, 300), (5.5, 1200, 700)),
    ],
)
def test_an_id_that_jumps_is_two_vehicles(
    last: tuple[float, float, float], first: tuple[float, float, float]
) -> None:
    seconds, x, y = first
    one, other = through((0, 200, 300), last), through(first, (seconds + 3, x + 50, y))
    video = joined(frames(one, seconds=13), numbered(frames(other, seconds=13), 1))
    assert events(video, LINE) == ()
    assert [path.vehicle for path in link_tracks(video, WIDTH, HEIGHT)] == [1, 2]


@pytest.mark.parametrize("rate", [1, 2, 25])
def test_a_fast_vehicle_of_one_id_is_one(rate: float) -> None:
    (path,) = link_tracks(frames(through((0, 100, 150), (3, 1200, 690)), rate=rate), WIDTH, HEIGHT)
    assert path.vehicle == 1
