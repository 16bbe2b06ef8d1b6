"""The best picture of each vehicle."""

from dataclasses import dataclass

from vdet.boxes import Box, Image
from vdet.media import Picture
from vdet.track.track import FrameTracks, Track

_PADDING = 0.1  # margin around a vehicle, as a fraction of the width and the height of its box
_MINIMUM = 24  # shortest side of a box that gets a picture, pixels

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
    if track.state != "detected" or min(box.width, box.height) < _MINIMUM:
        return None
    inside = box.x2 < picture.width and box.y2 < picture.height
    is_whole = inside and min(box.x1, box.y1) > 0
    return is_whole, box.area * track.score


def _cut(box: Box, picture: Picture) -> Image:
    box = box.rounded
    x, y = (round(side * _PADDING) for side in (box.width, box.height))
    return Box(box.x1 - x, box.y1 - y, box.x2 + x, box.y2 + y).cut(picture.image).copy()
