"""What is drawn on the frames of a video: shown cars and the lane, or a moment's stages."""

from collections.abc import Iterable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

from vdet.config.schema import FeatureSettings
from vdet.detect.svm.stages import write_pictures, write_stages
from vdet.draw.boxes import color_of, draw_box
from vdet.lanes.drawing import draw_lane
from vdet.lanes.road import Road
from vdet.media import Frame
from vdet.media.images import Image
from vdet.pipeline.result import FrameResult
from vdet.track.track import Track


def annotate(result: FrameResult) -> Frame:
    """Return the frame with its cars, drawn into the image it came with.

    Where lanes are looked for, it is the undistorted frame with the lane, and the cars' boxes are
    carried through the same undistortion.
    """
    frame, road, tracks = result.frame, result.road, result.tracks
    if road:
        frame = replace(frame, image=road.image)
        placed = (replace(track, box=road.place(track.box)) for track in tracks)
        tracks = tuple(track for track in placed if track.box.area)
        if road.lane:
            draw_lane(frame.image, road.lane)
    draw_tracks(frame.image, tracks)
    return frame


class StagePictures:
    """Makes the pictures of every stage of one moment, when its frame comes.

    Parameters
    ----------
    folder
        Where they go; None for no pictures.
    at
        Time of the moment in the file, seconds.
    """

    def __init__(self, folder: Path | None, at: Fraction, features: FeatureSettings) -> None:
        self._folder = folder
        self._at = at
        self._features = features

    @property
    def missing(self) -> bool:
        """Whether they are still to be made."""
        return self._folder is not None

    def offer(self, result: FrameResult) -> None:
        """Make them of this frame if it is the first at or after the time asked for."""
        if self._folder is None or result.frame.time < self._at:
            return
        write_stages(
            self._folder,
            result.frame.image,
            result.detection,
            [(track.box, track_label(track)) for track in result.tracks],
            features=self._features,
        )
        if result.road:
            write_lane_stages(self._folder, result.road)
        self._folder = None


def draw_tracks(image: Image, tracks: Iterable[Track]) -> None:
    """Draw the shown cars with their ids, each id in its own colour."""
    for track in tracks:
        draw_box(image, track.box, color_of(track.id), track_label(track))


def track_label(track: Track) -> str:
    """Name a car on a picture."""
    return f"#{track.id}"


def write_lane_stages(folder: Path, road: Road) -> None:
    """Write `6-road.png` … `9-fit.png` likewise: how the lane was found."""
    numbered = enumerate(road.pictures().items(), start=6)
    write_pictures(folder, {f"{number}-{name}": picture for number, (name, picture) in numbered})
