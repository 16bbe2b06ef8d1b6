"""Scenes of rectangles with known places: what the tracker shows of them, and under which id."""

import pytest

from boxing import moved_to
from track.motion.scenes import (
    CLEAR,
    FAINT,
    HEIGHT,
    WEAK,
    WIDTH,
    Scored,
    detections,
    first_shown,
    follow,
    frames,
    id_at,
    ids,
    inside,
    moving,
)
from vdet.boxes import Box
from vdet.config.schema import MotionTrackerSettings
from vdet.track.motion.tracker import PART, MotionTracker

CAR = Box.sized(400, 400, 100, 70)
DEFAULTS = MotionTrackerSettings()
CARRIED = frames(DEFAULTS.coast_seconds)


def test_evidence_weaker_than_the_leak_never_adds_up() -> None:
    assert ids(follow([[(CAR, DEFAULTS.decay)]] * 300)) == set()


def test_flicker_is_never_shown() -> None:
    places = [moved_to(CAR, x, 400) for x in (50, 300, 550, 800, 1050)]
    flicker = [[places[n % 5]] if n % 2 else [] for n in range(200)]
    assert ids(follow(flicker)) == set()


def test_a_vehicle_that_is_hardly_likely_is_not_shown() -> None:
    doubtful = (CAR, DEFAULTS.min_score - 0.01)
    assert ids(follow([[doubtful]] * 100)) == set()
    assert ids(follow([[doubtful]] * 100, min_score=0)) == {1}
    assert ids(follow([[(CAR, DEFAULTS.min_score)]] * 100)) == {1}


@pytest.mark.parametrize(("width", "height"), [(12, 6), (5, 14)], ids=["car", "motorcycle"])
def test_a_vehicle_is_shown_once_it_is_large_enough(width: int, height: int) -> None:
    minimum = DEFAULTS.min_size * WIDTH
    places = [Box.sized(600, 400, width * n / 20, height * n / 20) for n in range(20, 120)]
    shown = follow([place] for place in places)
    assert ids(shown) == {1}
    assert all(track.box.area**0.5 >= minimum for tracks in shown for track in tracks)
    assert places[first_shown(shown)].area ** 0.5 == pytest.approx(minimum, abs=2)


@pytest.mark.parametrize(("dx", "dy"), [(0, 0), (4, 0), (-4, 1), (15, 3)])
def test_a_steadily_moving_vehicle_is_shown_where_it_is(dx: float, dy: float) -> None:
    places = moving(CAR, dx, dy, frames=40)
    shown = follow([place] for place in places)
    assert ids(shown) == {1}
    for place, tracks in list(zip(places, shown, strict=True))[20:]:
        assert tracks[0].box.iou(place) > 0.97


def test_through_missed_frames_a_vehicle_is_shown_where_its_motion_leads() -> None:
    places = moving(CAR, dx=5, frames=40)
    clip = [[] if 30 <= n < 36 else [place] for n, place in enumerate(places)]
    shown = follow(clip)
    assert [track.state for tracks in shown[28:38] for track in tracks] == (
        ["detected"] * 2 + ["predicted"] * 6 + ["detected"] * 2
    )
    for place, tracks in list(zip(places, shown, strict=True))[30:]:
        assert id_at(tracks, place) == 1
        assert tracks[0].box.iou(place) > 0.9


def test_weak_detections_do_not_re_identify_a_lost_vehicle() -> None:
    faint = [(place, FAINT) for place in moving(CAR, dx=6, frames=10)]
    missed: list[list[Box]] = [[]] * (CARRIED + 1)
    shown = follow([*[[CAR]] * 20, *missed, *[[place] for place in faint], *[[CAR]] * 8])
    assert [id_at(tracks, CAR) for tracks in shown[-5:]] == [1] * 5


def test_weak_detections_do_not_lead_from_one_vehicle_to_the_next() -> None:
    there = moving(CAR, dx=5, frames=24)
    back = moving(there[-1], dx=-5, frames=20)
    faint = [[(place, FAINT)] for place in there]
    shown = follow([*[[CAR]] * 20, *faint, *[[place] for place in back]])
    assert ids(shown[:20]) == {1}
    assert [id_at(tracks, back[-1]) for tracks in shown[-1:]] == [2]


VAN = Box.sized(100, 390, 180, 130)


def test_a_vehicle_hidden_by_a_nearer_one_is_not_shown_and_keeps_its_id() -> None:
    vans = moving(VAN, dx=4, frames=160)
    clip = []
    for van in vans:
        covered = CAR.intersection(van).area / CAR.area
        clip.append([van] if covered > 0.5 else [van, CAR])
    shown = follow(clip)
    hidden = [len(frame) == 1 for frame in clip]
    assert sum(hidden) > 3 * CARRIED
    assert ids(shown) == {1, 2}
    car, van_id = id_at(shown[20], CAR), id_at(shown[20], vans[20])
    for n, tracks in enumerate(shown[20:], start=20):
        assert id_at(tracks, vans[n]) == van_id
        assert any(hidden[n - 3 : n + 1]) or id_at(tracks, CAR) == car  # it must be sure again
        assert not hidden[n] or [track.id for track in tracks] == [van_id]


def test_weak_detections_on_the_nearer_vehicle_do_not_move_the_hidden_one() -> None:
    arriving, hiding = moving(VAN, dx=6, frames=46), moved_to(VAN, 370, 390)
    parts: list[Scored] = [
        (Box.sized(400 - n // 2, 400 - n // 5, 100 + n, 70 + n), WEAK) for n in range(50)
    ]
    clip: list[list[Box] | list[Scored]] = [
        *[[CAR, van] for van in arriving],
        *[[(hiding, CLEAR), part] for part in parts],
        *[[van] for van in moving(hiding, dx=6, frames=12)],
        *[[van, CAR] for van in moving(moved_to(hiding, 442, 390), dx=6, frames=10)],
    ]
    shown = follow(clip)
    assert ids(shown) == {1, 2}
    assert id_at(shown[-1], CAR) == id_at(shown[10], CAR)
    assert id_at(shown[90], hiding) == id_at(shown[10], arriving[10])


def test_a_vehicle_that_comes_out_from_behind_is_shown_once_it_is_clearly_detected() -> None:
    hiding, half = moved_to(VAN, 370, 390), Box.sized(480, 400, 110, 70)  # behind the van
    assert half.intersection(hiding).area > PART * half.area
    before = [[CAR, van] for van in moving(VAN, dx=6, frames=46)]
    shown = follow([*before, *[[hiding]] * 20, *[[hiding, half]] * 6])
    assert id_at(shown[-1], half) == id_at(shown[10], CAR)
    assert len(follow([*[[hiding]] * 20, *[[hiding, half]] * 6])[-1]) == 1


def test_a_hidden_vehicle_does_not_take_the_detection_of_the_nearer_one() -> None:
    """Not even where the nearer one could have that of its part instead."""
    near, part = Box.sized(400, 300, 100, 70), Box.sized(400, 300, 63, 70)
    far = moved_to(near, 425, 285)
    shown = follow([[near, far]] * 30 + [[near, part]] * 2)
    assert shown[-1][0].id == id_at(shown[28][:1], near)
    assert shown[-1][0].box.iou(near) > 0.95


def test_a_vehicle_behind_another_one_is_a_vehicle() -> None:
    behind = Box.sized(480, 395, 90, 45)
    assert ids(follow([[CAR, behind]] * 10)) == {1, 2}


def test_a_small_vehicle_before_a_large_one_is_not_a_part_of_it() -> None:
    truck = Box.sized(300, 250, 300, 200)
    cars = moving(Box.sized(150, 400, 110, 80), dx=5, frames=60)
    shown = follow([truck, car] for car in cars)
    assert ids(shown) == {1, 2}
    assert [len(tracks) for tracks in shown[5:]] == [2] * 55


def test_a_shadow_that_is_taken_for_a_vehicle_keeps_none_that_brakes_over_it() -> None:
    shadow = (CAR, WEAK)
    speeds = [8.0] * 32 + [max(8 - 0.8 * n, 1.0) for n in range(58)]
    lefts = [round(100 + sum(speeds[:n])) for n in range(90)]
    cars = [moved_to(CAR, left, 400) for left in lefts]
    shown = follow([car] if abs(car.x1 - CAR.x1) < 60 else [car, shadow] for car in cars)
    assert id_at(shown[20], cars[20]) == id_at(shown[-1], cars[-1])


@pytest.mark.parametrize("side", ["left", "right"])
def test_what_has_left_over_a_side_does_not_come_back_as_another(side: str) -> None:
    leaving = [inside(place) for place in moving(moved_to(CAR, 120, 400), dx=-3, frames=46)]
    entering = [inside(place) for place in moving(moved_to(CAR, -20, 400), dx=3, frames=30)]
    clip = [*leaving, *[None] * 12, *entering]
    if side == "right":
        clip = [
            place and Box(WIDTH - place.x2, *(place.y1, WIDTH - place.x1, place.y2))
            for place in clip
        ]
    shown = follow([place] if place else [] for place in clip)
    assert [ids(shown[:50]), ids(shown[58:])] == [{1}, {2}]


def test_the_size_of_the_frame_does_not_matter() -> None:
    def doubled(box: Box) -> Box:
        return Box.sized(2 * box.x1, 2 * box.y1, 2 * box.width, 2 * box.height)

    places = [inside(place) for place in moving(Box.sized(900, 400, 120, 80), dx=8, frames=60)]
    large = MotionTracker(DEFAULTS, 2 * WIDTH, 2 * HEIGHT)
    shown = follow([place] for place in places)
    for n, (place, tracks) in enumerate(zip(places, shown, strict=True)):
        twice = large.update(detections([doubled(place)]), n / 25)
        assert [track.id for track in twice] == [track.id for track in tracks]
        for one, other in zip(tracks, twice, strict=True):
            assert doubled(one.box).iou(other.box) > 0.95


def test_a_vehicle_that_leaves_the_frame_stands_where_its_whole_box_does() -> None:
    last = follow([[box] for box in moving(moved_to(CAR, WIDTH - 160, 400), 8, frames=15)])[-1]
    (track,) = last
    assert track.box.x2 == WIDTH
    assert track.foot[0] > track.box.x1 + track.box.width / 2 + 5
    assert track.foot[1] == pytest.approx(470, abs=3)
