"""A frame at full, half, quarter … size, from which strips and windows are cut."""

import cv2
import numpy as np

from vdet.detect.svm.features import halve, resize
from vdet.media.images import Image


class FramePyramid:
    """The searched rows of one frame at full size and, made when needed, halved again and again.

    Parameters
    ----------
    image
        BGR uint8 `(H, W, 3)`.
    top, bottom
        First row that is searched, and first row below; None for the frame's end.
    margin
        Columns beyond the left and right of the frame that are searched too; they repeat its
        outermost columns.
    """

    def __init__(
        self, image: Image, top: int = 0, bottom: int | None = None, margin: int = 0
    ) -> None:
        rows = image[top:bottom]
        if margin:
            rows = np.asarray(
                cv2.copyMakeBorder(rows, 0, 0, margin, margin, cv2.BORDER_REPLICATE), np.uint8
            )
        self._origin = margin, -top
        self._levels = [rows]

    def crop(self, x: int, y: int, width: int, height: int) -> Image:
        """Return a window at full size; all in pixels of the frame, `x` may be negative."""
        left, top = x + self._origin[0], y + self._origin[1]
        return self._levels[0][top : top + height, left : left + width]

    def cut(self, rows: slice, columns: slice, width: int, height: int) -> Image:
        """Return a part of the frame, resized to `width` × `height`.

        `rows` and `columns` are pixels of the frame, columns may be negative. The result equals
        `resize(image[rows, columns], width, height)`; halvings are shared by all cuts.
        """
        across, down = self._origin
        sides = rows.start + down, rows.stop + down, columns.start + across, columns.stop + across
        level = 0
        while _halves_exactly(sides) and _is_twice(sides, width, height):
            sides = (sides[0] // 2, sides[1] // 2, sides[2] // 2, sides[3] // 2)
            level += 1
        part = self._level(level)[sides[0] : sides[1], sides[2] : sides[3]]
        return resize(part, width, height)

    def _level(self, number: int) -> Image:
        while len(self._levels) <= number:
            last = self._levels[-1]
            height, width = last.shape[:2]
            self._levels.append(halve(last[: height // 2 * 2, : width // 2 * 2]))
        return self._levels[number]


def _halves_exactly(sides: tuple[int, int, int, int]) -> bool:
    return all(side % 2 == 0 for side in sides)


def _is_twice(sides: tuple[int, int, int, int], width: int, height: int) -> bool:
    return sides[1] - sides[0] >= 2 * height and sides[3] - sides[2] >= 2 * width
