"""The original's settings, as they ship, for tests of its numbers."""

from vdet.config.loading import find_config, load_settings
from vdet.config.tracker import RulesTrackerSettings

SEED = load_settings([find_config("seed")])


def tracker_but(**changes: object) -> RulesTrackerSettings:
    """Return the original's tracker with some settings replaced."""
    return RulesTrackerSettings.model_validate(SEED.tracker.model_dump() | changes)


SEED_TRACKER = tracker_but()
