import pytest

from seed import SEED
from vdet.config.schema import RulesTrackerSettings, Settings
from vdet.track.factory import HoldingTracker, make_tracker
from vdet.track.motion.tracker import MotionTracker
from vdet.track.rules.tracker import RulesTracker


def test_the_kind_decides_which_tracker_it_is() -> None:
    assert isinstance(make_tracker(Settings(), 1280, 720), MotionTracker)
    rules = make_tracker(SEED, 1280, 720)
    assert isinstance(rules, HoldingTracker)
    assert isinstance(rules.tracker, RulesTracker)


def test_the_lengths_of_the_rules_are_scaled_to_the_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[RulesTrackerSettings] = []
    monkeypatch.setattr(RulesTracker, "__init__", lambda _, settings: made.append(settings))
    make_tracker(SEED, 640, 360)
    assert (made[0].min_region, made[0].near) == (25, 25)
