"""A whole video in pictures: the best one of each vehicle, and where vehicles were."""

from dataclasses import dataclass

import cv2
import numpy as np

from vdet.boxes import Box, Float32Array
from vdet.media import Picture
from vdet.media.images import Image
from vdet.track.track import FrameTracks, Track

_PADDING = 0.1  # margin around a vehicle, as a share of the width and the height of its box
_LEAST = 24  # shortest side of a box that gets a picture, pixels

_COLUMNS = 320  # of the heat map, at most
_FOOT = 0.25  # lower share of a box that is taken for the ground under the vehicle
_BLUR = 1.5  # of the heat map, standard deviation in its cells
_CLEAREST = 0.7  # share of colour where it is hottest

_Merit = tuple[bool, float]
"""Whether the vehicle is whole in the frame; its area in pixels times its score."""


@dataclass(frozen=True, slots=True)
class Crop:
    """A picture of a vehicle.

    `time` is that of the frame in seconds, `image` BGR uint8 `(H, W, 3)`.
    """

    id: int
    time: float
    image: Image


class BestCrops:
    """Finds the best picture of each vehicle, frame by frame.

    It keeps pictures only of vehicles that the last frame shows. Those of other vehicles are
    returned, so the memory does not grow with the length of the video.
    """

    def __init__(self) -> None:
        self._best: dict[int, Crop] = {}
        self._merits: dict[int, _Merit] = {}

    def add(self, frame: FrameTracks, picture: Picture) -> list[Crop]:
        """Add the next frame.

        Returns
        -------
        The best pictures so far of the vehicles that this frame no longer shows. If a vehicle comes
        back and gets a better picture, it is returned again.
        """
        shown = {track.id for track in frame.tracks}
        gone = [self._best.pop(number) for number in sorted(self._best.keys() - shown)]
        for track in frame.tracks:
            merit = _merit(track, picture)
            if merit and merit > self._merits.get(track.id, (False, 0.0)):
                self._merits[track.id] = merit
                self._best[track.id] = Crop(track.id, frame.time, _cut(track.box, picture))
        return gone

    def end(self) -> list[Crop]:
        """Return the pictures of the vehicles that the last frame shows."""
        return [crop for _, crop in sorted(self._best.items())]


def _merit(track: Track, picture: Picture) -> _Merit | None:
    """Return None where the vehicle was not seen, or is too small."""
    box = track.box.rounded
    if track.state != "seen" or min(box.width, box.height) < _LEAST:
        return None
    inside = box.x2 < picture.width and box.y2 < picture.height
    is_whole = inside and min(box.x1, box.y1) > 0
    return is_whole, box.area * track.score


def _cut(box: Box, picture: Picture) -> Image:
    box = box.rounded
    x, y = (round(side * _PADDING) for side in (box.width, box.height))
    return Box(box.x1 - x, box.y1 - y, box.x2 + x, box.y2 + y).cut(picture.image).copy()


class GroundHeat:
    """Adds up where vehicles stand, frame by frame.

    Parameters
    ----------
    width, height
        Size of the frames, pixels.
    """

    def __init__(self, width: int, height: int) -> None:
        self._scale = min(1.0, _COLUMNS / width)
        rows, columns = (max(1, round(side * self._scale)) for side in (height, width))
        self._cells: Float32Array = np.zeros((rows, columns), np.float32)

    def add(self, frame: FrameTracks) -> None:
        """Add the vehicles of a frame."""
        for track in frame.tracks:
            box = track.box
            top = max(0, int((box.y2 - _FOOT * box.height) * self._scale))
            left = max(0, int(box.x1 * self._scale))
            bottom = max(top + 1, round(box.y2 * self._scale))
            right = max(left + 1, round(box.x2 * self._scale))
            self._cells[top:bottom, left:right] += 1

    def over(self, still: Image) -> Image:
        """Return a picture of the frame, BGR uint8 `(H, W, 3)` of any size, with the heat over it.

        Yellow is where vehicles were longest. The colour grows with the square root of the time, so
        that a single vehicle can be seen too.
        """
        height, width = still.shape[:2]
        grey = cv2.cvtColor(cv2.cvtColor(still, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR)
        shares = self._cells / max(1.0, float(self._cells.max()))
        heat = cv2.GaussianBlur(np.sqrt(shares), (0, 0), _BLUR)
        heat = np.clip(cv2.resize(heat, (width, height)), 0, 1)
        color = cv2.applyColorMap((80 + 175 * heat).astype(np.uint8), cv2.COLORMAP_PLASMA)
        share = _CLEAREST * np.clip(4 * heat, 0, 1)[..., np.newaxis]
        return np.asarray(grey * (1 - share) + color * share, np.uint8)
