"""Strips: the part of a frame that a grid covers, at the scale where a window is a patch."""

from fractions import Fraction

import numpy as np
import numpy.typing as npt

from vdet.config.schema import FeatureSettings
from vdet.features import convert, resize
from vdet.images import Image
from vdet.windows import WindowGrid


class Strip:
    """Cuts a grid's strip out of frames.

    The strip begins at the grid's first window and ends with its last; a window's position in it
    is that in the frame times patch / size, whole pixels for the grids that get here.
    """

    def __init__(self, grid: WindowGrid, features: FeatureSettings) -> None:
        self._features = features
        self._columns, self.width = _extent(grid, features, grid.left, grid.columns)
        self._rows, self.height = _extent(grid, features, grid.top, grid.rows)

    def cut(self, image: Image) -> Image:
        """Return the strip of a frame, BGR uint8, in the features' colour space, `(h, w, 3)`."""
        part = image[self._rows, self._columns]
        return convert(resize(part, self.width, self.height), self._features)


def _extent(
    grid: WindowGrid, features: FeatureSettings, first: Fraction, count: int
) -> tuple[slice, int]:
    span = (count - 1) * grid.step + grid.size
    start = round(first)
    return slice(start, start + round(span)), round(span * features.patch / grid.size)


def channel_of(strip: Image, number: int, start: int = 0, stop: int | None = None) -> Image:
    """Return one channel of a strip's columns `start` to `stop`, contiguous `(h, w)`."""
    return np.ascontiguousarray(strip[:, start:stop, number])


def spans(columns: npt.NDArray[np.bool_], reach: int) -> list[tuple[int, int]]:
    """Return the runs of true columns as (first, one beyond last).

    Runs are joined where fewer than `reach` false columns part them.
    """
    (wanted,) = np.nonzero(columns)
    if not len(wanted):
        return []
    breaks = np.nonzero(np.diff(wanted) > reach)[0]
    firsts = wanted[np.concatenate([[0], breaks + 1])]
    lasts = wanted[np.concatenate([breaks, [len(wanted) - 1]])]
    return [(int(first), int(last) + 1) for first, last in zip(firsts, lasts, strict=True)]
