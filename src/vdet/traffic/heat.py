"""Where vehicles were: a map of how long the ground was covered, and its picture over a still."""

import cv2
import numpy as np

from vdet.boxes import Float32Array
from vdet.media.images import Image
from vdet.track.track import FrameTracks

_COLUMNS = 320  # of the map, at most
_FOOT = 0.25  # lower share of a box that is taken for the ground under the vehicle
_BLUR = 1.5  # of the map, standard deviation in its cells
_CLEAREST = 0.7  # share of colour where it is hottest


class HeatMap:
    """Adds up where vehicles stand, frame by frame.

    Parameters
    ----------
    width, height
        Of the frames, pixels.
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
        most = float(self._cells.max())
        if not most:
            return np.asarray(grey, np.uint8)
        heat = cv2.GaussianBlur(np.sqrt(self._cells / most), (0, 0), _BLUR)
        heat = np.clip(cv2.resize(heat, (width, height)), 0, 1)
        color = cv2.applyColorMap((80 + 175 * heat).astype(np.uint8), cv2.COLORMAP_PLASMA)
        share = _CLEAREST * np.clip(4 * heat, 0, 1)[..., np.newaxis]
        return np.asarray(grey * (1 - share) + color * share, np.uint8)
