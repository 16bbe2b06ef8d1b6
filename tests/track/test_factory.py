from boxing import moved_to
from seed import SEED
from vdet.boxes import NO_BOXES, Box, Boxes
from vdet.config.schema import Settings
from vdet.media import Picture
from vdet.track.motion.tracker import MotionTracker
from vdet.track.rules import RulesTracker
from vdet.track.track import InterpolatingTracker, Track, make_tracker


def test_the_kind_decides_which_tracker_it_is() -> None:
    assert isinstance(make_tracker(Settings(), 1280, 720), MotionTracker)
    rules = make_tracker(SEED, 1280, 720)
    assert isinstance(rules, InterpolatingTracker)
    assert isinstance(rules.tracker, RulesTracker)


CAR = Box.sized(100, 100, 50, 40)


class SeesOne:
    """A tracker that shows one vehicle in each frame that it gets, and notes the times."""

    def __init__(self) -> None:
        self.times: list[float] = []

    def update(self, _: Boxes, time: float, __: Picture | None = None) -> list[Track]:
        self.times.append(time)
        return [Track(1, moved_to(CAR, 100 + round(100 * time), 100), 0.9, state="detected")]


def test_between_two_searched_frames_vehicles_move_straight() -> None:
    tracker = InterpolatingTracker(SeesOne())
    tracker.observe(NO_BOXES, 1.0)
    tracker.observe(NO_BOXES, 1.4)
    for time, x, state in (
        (1.0, 200, "detected"),
        (1.1, 210, "interpolated"),
        (1.4, 240, "detected"),
    ):
        (track,) = tracker.at(time)
        assert (track.box, track.state) == (moved_to(CAR, x, 100), state)


def test_after_the_latest_searched_frame_vehicles_stay_where_they_were() -> None:
    tracker = InterpolatingTracker(SeesOne())
    tracker.observe(NO_BOXES, 1.0)
    (seen,) = tracker.at(1.0)
    for time in (1.1, 1.2):
        (held,) = tracker.at(time)
        assert (held.id, held.box, held.score) == (seen.id, seen.box, seen.score)
        assert (seen.state, held.state) == ("detected", "interpolated")
