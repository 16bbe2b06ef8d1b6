"""The frame that pages and workbooks show: the one with the most vehicles."""

from collections.abc import Iterable

import cv2
import numpy as np

from vdet.boxes import Image
from vdet.media.images import coarse_scale, shrunk
from vdet.run.steps import FrameResult
from vdet.traffic.records import VehicleRecord


class Poster:
    """Keeps the frame with the most vehicles; `is_coarse` is `output.coarse`."""

    def __init__(self, *, is_coarse: bool) -> None:
        self._is_coarse = is_coarse
        self._best: FrameResult | None = None

    def add(self, result: FrameResult) -> None:
        """Add a frame."""
        if self._best is None or len(result.tracks) > len(self._best.tracks):
            self._best = result

    def image(self, vehicles: Iterable[VehicleRecord]) -> Image | None:
        """Return the frame, BGR uint8, at its own size; None without frames.

        `vehicles` are all of the video: no detail is kept that would show their plates.
        """
        if self._best is None:
            return None
        image, boxes = self._best.frame.image, [vehicle.largest for vehicle in vehicles]
        if not self._is_coarse:
            return image
        height, width = image.shape[:2]
        largest = max((side for box in boxes for side in (box.width, box.height)), default=0)
        reduced = shrunk(image, coarse_scale(largest, height))
        return np.asarray(cv2.resize(reduced, (width, height)), np.uint8)  # marks are drawn on it

    def with_boxes(self, image: Image | None) -> Image | None:
        """Return a copy of the frame, as `image` returns it, with a box around each vehicle."""
        if self._best is None or image is None:
            return None
        drawn = image.copy()
        self._best.draw_tracks(drawn, ())
        return drawn
