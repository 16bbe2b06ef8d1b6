"""Watches the conditions of one video: small planes of its frames, and what was found in them."""

from collections.abc import Sequence

import cv2
import numpy as np

from vdet.boxes import Box, Boxes, Image
from vdet.conditions import visibility
from vdet.conditions.camera import CameraWatch
from vdet.conditions.finding import Finding
from vdet.conditions.motion import MotionWatch
from vdet.config.schema import Settings
from vdet.media import Picture
from vdet.track.track import Track

_STEP = 0.24
"""Seconds between two planes."""
_WIDTH = 320
"""Of a plane, pixels; what moves is measured on planes of half of it."""
_NARROW = 320
"""Width of frames that are smaller than any the detectors were measured on, pixels."""


class Conditions:
    """Measures what makes the results of one video doubtful, a few times in a second.

    Parameters
    ----------
    width
        Of the frames, pixels.
    unknown
        Classes that the settings ask for and the network does not know.
    """

    def __init__(self, settings: Settings, width: int, unknown: Sequence[str] = ()) -> None:
        self._settings = settings
        self._width = width
        self._unknown = unknown
        self._camera, self._motion = CameraWatch(), MotionWatch()
        self._times: list[float] = []
        self._sights: list[visibility.Sight] = []

    @property
    def is_still(self) -> bool:
        """Whether the camera stood still."""
        return self._camera.is_still

    def add(self, time: float, picture: Picture, found: Boxes, tracks: Sequence[Track]) -> None:
        """Add a frame that was searched, with its detections and the vehicles that are shown."""
        if self._times and time - self._times[-1] < _STEP:
            return
        fine_plane = small_luma(picture)
        plane = halved(fine_plane)
        scores = np.array([item.score for item in found], np.float64)
        self._sights.append(visibility.Sight.of(fine_plane, plane, scores))
        scale = plane.shape[1] / picture.width
        boxes = {track.id: _enlarged(track.box, scale) for track in tracks}
        self._times.append(time)
        if not self._camera.add(time, plane, boxes.values()):
            self._motion.reset()
        self._motion.add(time, plane, boxes)

    def findings(self) -> tuple[Finding, ...]:
        """Return what was found out so far, but for what the settings leave out."""
        settings, found = self._settings, self._of_settings()
        if settings.traffic or settings.regions or settings.camera.ground:
            is_clear = np.array([sight.code is None for sight in self._sights], bool)
            found += self._camera.findings(is_clear)
        if self.is_still:
            found += self._motion.findings()
        detector = settings.detector
        is_shipped = detector.kind == "net" and detector.model is None
        found += visibility.findings(self._times, self._sights, is_shipped=is_shipped)
        return tuple(item for item in found if item.code not in settings.conditions.ignore)

    def _of_settings(self) -> list[Finding]:
        """Return what the settings and the size of the frames make doubtful."""
        found, settings = [], self._settings
        if settings.lack_of_metres:
            found.append(Finding("lane-geometry", settings.lack_of_metres))
        if self._unknown:
            text = f"detector.classes: the network does not know {', '.join(self._unknown)}"
            found.append(Finding("classes", text))
        if self._width < _NARROW:
            text = (
                f"frames are {self._width} pixels wide, fewer than in measurements of the detectors"
            )
            found.append(Finding("small-frames", text, severity="note"))
        return found


def halved(plane: Image) -> Image:
    """Return a plane of half the width and height."""
    height, width = plane.shape
    half = max(1, round(width / 2)), max(1, round(height / 2))
    return np.asarray(cv2.resize(plane, half, interpolation=cv2.INTER_AREA), np.uint8)


def small_luma(picture: Picture) -> Image:
    """Return the luma of a picture, full range, at most `_WIDTH` pixels wide, uint8 `(h, w)`."""
    width = min(_WIDTH, picture.width)
    size = width, max(1, round(picture.height * width / picture.width))
    planes = picture.planes
    pixels = planes.luma if planes else picture.image
    small = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    if planes is None:
        small = cv2.cvtColor(small, cv2.COLOR_BGR2GRAY)
    elif not planes.coding.full_range:
        small = cv2.convertScaleAbs(small, alpha=255 / 219, beta=-16 * 255 / 219)
    return np.asarray(small, np.uint8)


def _enlarged(box: Box, scale: float) -> Box:
    """Return a box in pixels of a plane, with a vehicle's shadow around it."""
    x, y, width, height = (scale * side for side in (box.x1, box.y1, box.width, box.height))
    return Box.sized(x - width / 4, y - height / 4, 1.5 * width, 1.5 * height)
