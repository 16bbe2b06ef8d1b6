"""Watches the conditions of one video: small planes of its frames, and their detections."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import cv2
import numpy as np

from vdet.boxes import Box, Boxes, Image
from vdet.conditions import visibility
from vdet.conditions.camera import CameraWatch
from vdet.conditions.motion import MotionWatch, WeakWatch
from vdet.config.schema import Settings
from vdet.detect.onnx.water import is_wet
from vdet.errors import clock_text
from vdet.findings import Finding, Findings, at_places, without
from vdet.media import Picture
from vdet.track.track import Track

if TYPE_CHECKING:  # loaded with `--lanes`
    from vdet.lanes.road import Lane

_STEP = 0.19
"""Minimum seconds between two planes; searches of an empty road are 0.2 to 0.25 seconds apart."""
_WIDTH = 320
"""Width of a plane, pixels; motion is measured on planes of half this width."""
_MOST = 3
"""Maximum number of cuts that a finding names."""
_NARROW = 320
"""Minimum width of the frames that the detectors were measured on, pixels."""
_FEW = 0.1
"""Fraction of the frames; a lane that is found in fewer is doubtful."""


class Conditions:
    """Looks for reasons to doubt the results of one video, a few times per second.

    Parameters
    ----------
    width
        Width of the frames, pixels.
    """

    def __init__(self, settings: Settings, width: int) -> None:
        self._settings = settings
        self._width = width
        lines = {line.name: (line.start, line.end) for line in settings.traffic.lines}
        self._camera, self._motion, self._weak = CameraWatch(), MotionWatch(lines), WeakWatch()
        is_shipped = settings.detector.kind == "net" and settings.detector.model is None
        self._visibility = visibility.VisibilityWatch(is_shipped=is_shipped)
        self._time: float | None = None
        self._cuts: list[float] = []
        self._frames = self._lanes = self._rows = self._placed = 0
        """Number of frames, of those with a lane, of boxes, and of those with a distance."""

    def cut(self, time: float) -> None:
        """Begin anew with the next frame, before which there is a jump cut."""
        self._cuts.append(time)
        self._camera.restart()
        self._motion.restart()

    def add(
        self, time: float, picture: Picture, detections: Boxes, tracks: Sequence[Track]
    ) -> None:
        """Add a searched frame, with its detections and the vehicles shown."""
        if self._time is not None and time - self._time < _STEP:
            return
        self._time = time
        fine_plane, plane = planes_of(picture)
        scale = plane.shape[1] / picture.width
        boxes = {track.id: _enlarged(track.box, scale) for track in tracks}
        measures = visibility.measure(fine_plane, plane, detections.scores)
        is_clear = self._visibility.add(time, measures, is_wet=is_wet(fine_plane))
        is_steady = self._camera.add(time, plane, boxes.values(), is_clear=is_clear)
        self._motion.add(time, plane, boxes, is_steady=is_steady)
        self._weak.add(time, picture, detections, tracks)

    def add_road(self, lane: "Lane | None", tracks: Sequence[Track]) -> None:
        """Add the lane of a frame, and the vehicles on the road."""
        self._frames += 1
        self._lanes += lane is not None
        self._rows += len(tracks)
        self._placed += sum(track.distance is not None for track in tracks)

    @property
    def is_moving(self) -> bool:
        """Whether the camera moved in more than a tenth of the planes so far."""
        return self._camera.is_moving

    def findings(self) -> Findings:
        """Return the findings so far, except those that the settings suppress."""
        settings, findings = self._settings, []
        if settings.lack_of_metres:
            findings.append(Finding("lane-geometry", settings.lack_of_metres, severity="note"))
        if settings.camera.lack_of_speeds:
            findings.append(Finding("ground", settings.camera.lack_of_speeds))
        if self._lanes < _FEW * self._frames:
            text = f"the lane was found in {self._lanes} of {self._frames} frames"
            findings.append(Finding("lane", f"{text}: check lanes.points in --stages"))
        elif self._rows and not (self._placed or settings.lack_of_metres):
            text = "no box has a distance: all are cut, or farther away than lanes.points reach"
            findings.append(Finding("lane", text))
        if self._width < _NARROW:
            text = f"frames are {self._width} pixels wide; detectors were measured on wider ones"
            findings.append(Finding("small-frames", text, severity="note"))
        if self._cuts:
            at = " and ".join(clock_text(int(time)) for time in self._cuts[:_MOST])
            more = f" and {len(self._cuts) - _MOST} more times" if len(self._cuts) > _MOST else ""
            text = f"the video was cut at {at}{more}: tracks end there; lines may match one part"
            findings.append(Finding("cut", text, tuple((time, time) for time in self._cuts)))
        if self._time is not None:
            camera = self._camera.findings()
            has_places = settings.traffic or settings.regions or settings.camera.ground
            findings += at_places(camera) if has_places else camera
            if self._camera.is_still:
                findings += self._motion.findings()
            elif self._camera.travels:
                findings += self._weak.findings()
            findings += self._visibility.findings()
        chosen = without(findings, settings.conditions.ignore)
        facts = tuple(item for item in chosen if item.severity == "fact")
        items = tuple(item for item in chosen if item.severity != "fact")
        return Findings(items, self._camera.is_still, facts)


def planes_of(picture: Picture) -> tuple[Image, Image]:
    """Return the luma of a picture, full range, uint8: a plane, and one of half its size."""
    width = min(_WIDTH, picture.width)
    height = max(1, round(picture.height * width / picture.width))
    fine = picture.scaled_luma(width, height)
    half = max(1, width // 2), max(1, height // 2)
    return fine, np.asarray(cv2.resize(fine, half, interpolation=cv2.INTER_AREA), np.uint8)


def _enlarged(box: Box, scale: float) -> Box:
    """Return a box in pixels of a plane, enlarged for the shadow of the vehicle."""
    x, y, width, height = (scale * side for side in (box.x1, box.y1, box.width, box.height))
    return Box.sized(x - width / 4, y - height / 4, 1.5 * width, 1.5 * height)
