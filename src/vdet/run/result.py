"""The result of one frame."""

from dataclasses import dataclass, field
from pathlib import Path

from vdet.detect.detections import Detections
from vdet.detect.protocol import VideoDetector
from vdet.lanes.road import Road
from vdet.media import Frame
from vdet.media.images import Image
from vdet.track.track import FrameTracks, Track


@dataclass(frozen=True, slots=True)
class FrameResult:
    """A frame, what was detected in it, and the vehicles that are shown.

    Attributes
    ----------
    source
        The video, or the still picture.
    frame
        The frame as it was read. All sinks get the same image, so none may change it.
    detections, tracks
        In pixels of that frame.
    road
        The lane, and the undistorted frame; None if lanes are not searched for.
    detector
        The detector that found `detections`.
    searched
        Whether the detector searched the frame: see `detector.stride`. Where it did not, there are
        no detections, and the tracks are predicted.
    """

    source: Path
    frame: Frame
    detections: Detections
    tracks: tuple[Track, ...]
    road: Road | None
    detector: VideoDetector = field(repr=False)
    searched: bool = True

    @property
    def frame_tracks(self) -> FrameTracks:
        """The tracks with the number and the time of the frame."""
        return FrameTracks(self.frame.index, float(self.frame.time), self.tracks)

    def stage_pictures(self) -> dict[str, Image]:
        """Return a picture of each stage of the detection, by name, in order."""
        return self.detector.stage_pictures(self.frame.image, self.detections)
