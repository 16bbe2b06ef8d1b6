"""The original's settings, as they ship, for tests of its numbers."""

from vdet.resources import find_config

from vdet.config.loading import load_settings
from vdet.config.schema import RulesTrackerSettings

SEED = load_settings(find_config("seed")).settings


def tracker_but(**changes: object) -> RulesTrackerSettings:
    """Give the original's tracker with some settings replaced."""
    return RulesTrackerSettings.model_validate(SEED.tracker.model_dump() | changes)
