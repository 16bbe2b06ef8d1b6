"""Which tracker follows a video's vehicles."""

from vdet.config.scaling import scale_lengths
from vdet.config.schema import MotionTrackerSettings, Settings
from vdet.track.protocol import VideoTracker


def make_tracker(settings: Settings, width: int, height: int) -> VideoTracker:
    """Return a new tracker by `tracker.method`, for frames of `width` × `height` pixels."""
    if isinstance(settings.tracker, MotionTrackerSettings):
        from vdet.track.motion.tracker import MotionTracker  # scipy takes long to import

        return MotionTracker(settings.tracker, width, height)
    from vdet.track.rules.tracker import RulesTracker

    return RulesTracker(scale_lengths(settings.tracker, height / settings.reference_height))
