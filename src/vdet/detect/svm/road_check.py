"""A warning where the shipped linear model does not know a road: the network finds other boxes."""

import logging
from collections.abc import Callable

from vdet.boxes import Boxes, Float64Array, iou_matrix
from vdet.detect.protocol import DetectorModel
from vdet.media import Picture

log = logging.getLogger("vdet")

LEAST_SCORE = 0.5
LEAST_WIDTH = 0.06
"""Share of the frame's width. Narrower vehicles are not compared: the linear model does not search
for them."""

LEAST_BOXES = 6
"""Least number of boxes, of both detectors together, by which the model is judged."""

LEAST_AGREEMENT = 0.5
"""Least share of boxes that both have on a road that the model knows. It is 0.67 to 1.0 on the
project video, by the stride, and 0 to 0.42 in 26 sets of pictures of other roads."""

_LEAST_IOU = 0.4


class RoadCheck:
    """Compares a detector with another one in a few frames, and warns once where they differ.

    Parameters
    ----------
    load_other
        Returns the other detector; it is called for each frame that is compared.
    """

    def __init__(self, load_other: Callable[[], DetectorModel]) -> None:
        self._load_other = load_other
        self._seen = self._both = self._all = 0
        self._has_warned = False

    def restarted(self) -> "RoadCheck":
        """Return a check with the same detector that has seen nothing yet."""
        return RoadCheck(self._load_other)

    def compare(self, picture: Picture, found: Boxes) -> None:
        """Compare what is found in the next picture or frame with what the other detector finds.

        Only 0, 1, 2, 4, 8, … are compared, so that a clip of any length is compared in a few.
        """
        number, self._seen = self._seen, self._seen + 1
        if self._has_warned or number & (number - 1):
            return
        other = self._load_other().for_video(picture.width, picture.height, [picture.image])
        seen = other.detect(other.search(picture, number))
        ours, theirs = (_compared(each, picture.width) for each in (found, seen))
        overlaps = iou_matrix(ours, theirs) >= _LEAST_IOU
        self._both += int(overlaps.any(axis=1).sum() + overlaps.any(axis=0).sum())
        self._all += len(ours) + len(theirs)
        if self._all >= LEAST_BOXES and self._both < LEAST_AGREEMENT * self._all:
            self._has_warned = True
            log.warning(
                "the linear model does not seem to know this road: it agrees with the network on "
                "%d %% of the boxes; leave out -c svm",
                round(100 * self._both / self._all),
            )


def _compared(found: Boxes, width: int) -> Float64Array:
    wide = found.sides[:, 2] - found.sides[:, 0] >= LEAST_WIDTH * width
    return found.sides[wide & (found.scores >= LEAST_SCORE)]
