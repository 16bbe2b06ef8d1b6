"""Which of the two trackers follows a video's vehicles."""

from collections.abc import Callable, Sequence

from vdet.config.schema import Settings
from vdet.config.section import scale_lengths
from vdet.detect.svm.heat import Region
from vdet.media.images import Image
from vdet.track.rules.tracker import Cars
from vdet.track.track import Track

Follow = Callable[[Image, Sequence[Region]], list[Track]]
"""Takes the next frame, BGR uint8 `(H, W, 3)`, and its regions; gives the shown tracks, by id."""


def tracker_of(settings: Settings, width: int, height: int) -> Follow:
    """Return the tracker that `tracker.method` names, new, for frames of `width` × `height`."""
    if settings.tracker.method == "rules":
        return Cars(scale_lengths(settings.tracker, height / settings.reference_height)).update
    from vdet.track.motion import MotionTracker  # scipy takes long to import

    tracker = MotionTracker(settings.tracker.motion, width, height)
    return lambda _, regions: tracker.update(regions)
