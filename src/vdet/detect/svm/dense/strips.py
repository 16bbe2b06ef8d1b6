"""Strips: the part of a frame that a grid covers, at the scale where a window is a patch."""

from fractions import Fraction

from vdet.config.schema import FeatureSettings
from vdet.detect.svm.features import convert
from vdet.detect.svm.pyramid import FramePyramid
from vdet.detect.svm.windows import WindowGrid
from vdet.media.images import Image


class Strip:
    """Cuts a grid's strip out of frames.

    The strip begins at the grid's first window and ends with its last; a window's position in it
    is that in the frame times patch / size, whole pixels for the grids that get here.
    """

    def __init__(self, grid: WindowGrid, features: FeatureSettings) -> None:
        self._features = features
        self._columns, self._width = _extent(grid, features, grid.left, grid.columns)
        self._rows, self._height = _extent(grid, features, grid.top, grid.rows)

    def cut(self, frame: FramePyramid) -> Image:
        """Return the strip of a frame in the features' colour space, uint8 `(h, w, 3)`."""
        strip = frame.cut(self._rows, self._columns, self._width, self._height)
        return convert(strip, self._features)


def _extent(
    grid: WindowGrid, features: FeatureSettings, first: Fraction, count: int
) -> tuple[slice, int]:
    span = (count - 1) * grid.step + grid.size
    start = round(first)
    return slice(start, start + round(span)), round(span * features.patch / grid.size)
