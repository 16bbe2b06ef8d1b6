"""The result of one frame."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import cv2

from vdet.boxes import Boxes
from vdet.draw.boxes import color_of, draw_box
from vdet.media import Frame
from vdet.track.track import FrameTracks, Track

if TYPE_CHECKING:
    from vdet.lanes.road import Road


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
        The lane; None if lanes are not looked for.
    searched
        Whether the detector searched the frame: see `detector.stride`. Where it did not, there are
        no detections.
    """

    source: Path
    frame: Frame
    detections: Boxes
    tracks: tuple[Track, ...]
    road: "Road | None" = None
    searched: bool = True

    @property
    def frame_tracks(self) -> FrameTracks:
        """The tracks with the number and the time of the frame, and its lane if there is one."""
        facts = {"lane": self.road.record()} if self.road else {}
        return FrameTracks(self.frame.index, float(self.frame.time), self.tracks, facts)

    def _repr_png_(self) -> bytes:
        """Return the frame with its vehicles, which notebooks show."""
        image = self.frame.image.copy()
        for track in self.tracks:
            label = f"#{track.id} {track.class_name or ''}".rstrip()
            draw_box(image, track.box, color_of(track.id), label, dashed=track.state == "lost")
        return cv2.imencode(".png", image)[1].tobytes()
