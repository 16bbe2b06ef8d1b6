"""What is shown of a frame once the frames after it were searched."""

from collections.abc import Callable, Iterable, Sequence

import numpy as np
import pytest

from boxing import moved_to
from track.motion.scenes import HEIGHT, WIDTH, Scored, detections, ids, inside, moving
from vdet.boxes import Box
from vdet.config.schema import MotionTrackerSettings
from vdet.track.motion.tracker import MotionTracker
from vdet.track.track import Track

CAR = Box.sized(400, 400, 100, 70)
RATE = 25
DEFAULTS = MotionTrackerSettings()
AHEAD = round(DEFAULTS.look_ahead * RATE)
"""Frames that are searched before one is shown."""


def shown_later(
    clip: Iterable[Sequence[Box] | Sequence[Scored]], stride: int = 1
) -> list[list[Track]]:
    """Return what is shown in each frame, `AHEAD` frames later or at the end of the clip."""
    tracker = MotionTracker(DEFAULTS, WIDTH, HEIGHT)
    shown = []
    frames = list(clip)
    for number in range(len(frames) + AHEAD):
        if number < len(frames) and number % stride == 0:
            tracker.observe(detections(frames[number]), number / RATE)
        if number >= AHEAD:
            shown.append(tracker.at((number - AHEAD) / RATE))
    return shown


def states(shown: Sequence[Sequence[Track]], number: int = 1) -> list[str]:
    """Return the state of a vehicle in each frame, "" where it is not shown."""
    by_frame = ({track.id: track.state for track in tracks} for tracks in shown)
    return [found.get(number, "") for found in by_frame]


def test_a_vehicle_is_shown_from_its_first_weak_detection_to_its_last() -> None:
    seen: list[list[Scored]] = [[(CAR, 0.35)]] * 3 + [[(CAR, 0.9)]] * 30
    shown = shown_later([*[[]] * 5, *seen, *[[]] * 30])
    assert states(shown) == [""] * 5 + ["detected"] * 33 + [""] * 30


def test_between_two_searches_a_vehicle_is_on_its_way_from_one_to_the_other() -> None:
    """It brakes: what came before does not tell where it is."""
    places = [moved_to(CAR, round(100 + 12 * n - 0.1 * n * n), 400) for n in range(40)]
    shown = shown_later([[place] for place in places], stride=3)
    assert states(shown[:37]) == [("interpolated", "detected")[n % 3 == 0] for n in range(37)]
    for place, (track,) in zip(places[6:37], shown[6:37], strict=True):
        assert track.box.iou(place) > 0.92


@pytest.mark.parametrize(("missed", "state"), [(AHEAD - 4, "interpolated"), (AHEAD + 3, "")])
def test_a_gap_is_bridged_if_the_look_ahead_shows_that_it_ends(missed: int, state: str) -> None:
    places = moving(CAR, dx=4, frames=80)
    clip = [[] if 30 <= n < 30 + missed else [place] for n, place in enumerate(places)]
    shown = shown_later(clip)
    assert states(shown) == ["detected"] * 30 + [state] * missed + ["detected"] * (50 - missed)
    assert all(t.box.iou(p) > 0.9 for p, tracks in zip(places, shown, strict=True) for t in tracks)


def test_a_vehicle_that_comes_in_at_the_side_is_shown_before_its_first_detection() -> None:
    places = moving(Box.sized(WIDTH - 40, 400, 200, 140), dx=-8, frames=60)
    clip = [[inside(place)] if n >= 6 else [] for n, place in enumerate(places)]
    shown = shown_later(clip)
    assert states(shown)[1:7] == ["interpolated"] * 5 + ["detected"]
    for place, tracks in list(zip(places, shown, strict=True))[2:]:
        assert tracks[0].box.iou(inside(place)) > 0.7


def test_one_that_has_left_the_frame_is_shown_where_it_was() -> None:
    places = moving(moved_to(CAR, WIDTH - 200, 400), dx=10, frames=40)
    clip = [[inside(place)] if place.x1 < WIDTH - 10 else [] for place in places]
    shown = shown_later(clip)
    assert states(shown)[:15] == ["detected"] * 15
    assert ids(shown) == {1}
    assert shown[-1] == []


def test_boxes_tremble_less_than_detections() -> None:
    rng = np.random.default_rng(1)
    places = moving(CAR, dx=5, dy=1, frames=100)
    noisy = [moved_to(p, p.x1 + rng.normal(0, 4), p.y1 + rng.normal(0, 3)) for p in places]
    lefts: Callable[[Iterable[Box]], list[float]] = lambda boxes: [box.x1 for box in boxes]  # noqa: E731
    drawn = lefts(track.box for tracks in shown_later([[p] for p in noisy]) for track in tracks)
    change = [np.abs(np.diff(sides, 2)).mean() for sides in (drawn, lefts(noisy))]
    assert change[0] < 0.15 * change[1]
    assert np.abs(np.subtract(drawn, lefts(places))).mean() < 2.5
