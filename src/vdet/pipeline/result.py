"""What a run knows of a frame."""

from dataclasses import dataclass, field
from pathlib import Path

from vdet.detect.detections import Detections
from vdet.detect.protocol import VideoDetector
from vdet.lanes.road import Road
from vdet.media import Frame
from vdet.media.images import Image
from vdet.track.track import Track


@dataclass(frozen=True, slots=True)
class FrameResult:
    """A frame, what was found in it, and the vehicles that are shown.

    `detections` and `tracks` are in pixels of the frame as it was read; `road` holds the frame
    undistorted, and is None where lanes are not looked for. `source` is the video or the picture.
    Nobody changes the frame's image: all sinks get the same one.
    """

    source: Path
    frame: Frame
    detections: Detections
    tracks: tuple[Track, ...]
    road: Road | None
    detector: VideoDetector = field(repr=False)

    def stage_pictures(self) -> dict[str, Image]:
        """Return a picture of each stage of the detection, by name, the first one first."""
        return self.detector.stage_pictures(self.frame.image, self.detections)
