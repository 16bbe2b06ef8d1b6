"""What the stream knows of a frame."""

from dataclasses import dataclass

from vdet.detect.svm.detector import Detection
from vdet.lanes.road import Road
from vdet.media import Frame
from vdet.track.track import Track


@dataclass(frozen=True, slots=True)
class FrameResult:
    """A frame, what was found in it, and the cars that are shown.

    `detection` and `tracks` are in pixels of the frame as it was read, `road` holds it undistorted;
    `road` is None where lanes are not looked for.
    """

    frame: Frame
    detection: Detection
    tracks: tuple[Track, ...]
    road: Road | None = None
