"""What a format of tracks is: how its files end, how they are written and how they are read."""

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Protocol

from vdet.labels.saved import SavedTracks
from vdet.lanes.road import Road
from vdet.track.track import FrameTracks, Track

UNKNOWN = "vehicle"
"""What a vehicle without a class is called where a format needs a name."""


@dataclass(frozen=True, slots=True)
class SourceVideo:
    """What a file of tracks says about its video.

    Attributes
    ----------
    name
        Of the file, without its folder.
    width, height
        Of the upright frames, pixels.
    frames
        How many frames the video has, if only a part of it is read and the number is known.
    """

    name: str
    width: int
    height: int
    frames: int | None = None


class TrackWriter(Protocol):
    """Writes the tracks of a video into a binary file that another opens and closes."""

    def write(self, frame: FrameTracks, road: Road | None = None) -> None:
        """Add a frame; `road` is given if the lane was looked for."""

    def end(self) -> None:
        """Write what is left. It is not called after an error."""


@dataclass(frozen=True, slots=True)
class Format:
    """A format of tracks.

    Attributes
    ----------
    name
        For messages.
    ending
        How the names of its files end, lower case, beginning with a dot.
    open
        Function that takes a binary file and the video and returns the writer. There is no video
        if the tracks are of still pictures.
    read
        Function that takes the path of a file, for messages, and its content. It raises
        `TruthError` with the place of the first mistake; the rows that it returns are not checked
        otherwise.
    needs_video
        Whether it cannot be written without a video.
    """

    name: str
    ending: str
    open: Callable[[BinaryIO, SourceVideo | None], TrackWriter]
    read: Callable[[Path, bytes], SavedTracks]
    needs_video: bool = False


class TrackLabels:
    """One name for each track, where a format has only one: the class with most score."""

    def __init__(self) -> None:
        self._scores: dict[int, dict[str, float]] = defaultdict(lambda: defaultdict(float))

    def add(self, track: Track) -> None:
        """Count the class of a track in one frame."""
        self._scores[track.id][track.class_name or UNKNOWN] += track.score

    def label(self, number: int) -> str:
        """Return the name of the track with this id; of equal ones the first."""
        scores = self._scores[number]
        return max(scores, key=scores.__getitem__)
