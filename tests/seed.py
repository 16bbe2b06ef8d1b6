"""The original's settings, as they ship, for tests of its numbers."""

from vdet.config.kinds import RulesTrackerSettings
from vdet.config.loading import find_config, load_settings

SEED = load_settings([find_config("seed")])


def tracker_but(**changes: object) -> RulesTrackerSettings:
    """Return the original's tracker with some settings replaced."""
    return RulesTrackerSettings.model_validate(SEED.tracker.model_dump() | changes)


SEED_TRACKER = tracker_but()
