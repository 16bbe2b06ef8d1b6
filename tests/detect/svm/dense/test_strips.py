from fractions import Fraction

import numpy as np
import numpy.typing as npt
import pytest

from detect.svm.dense.reference import SEED_FEATURES
from vdet.config.schema import FeatureSettings, HogSettings
from vdet.detect.svm.dense.strips import Strip
from vdet.detect.svm.features import convert, to_patch
from vdet.detect.svm.pyramid import FramePyramid
from vdet.detect.svm.windows import WindowGrid
from vdet.media.images import Image

FRAME = np.random.default_rng(0).integers(0, 256, (300, 400, 3), dtype=np.uint8)


@pytest.mark.parametrize(
    ("grid", "width", "height"),
    [
        (WindowGrid(64, Fraction(8), Fraction(0), Fraction(0), 10, 3), 64 + 9 * 8, 64 + 2 * 8),
        (WindowGrid(64, Fraction(8), Fraction(5), Fraction(7), 1, 1), 64, 64),
        (WindowGrid(128, Fraction(50), Fraction(25), Fraction(50), 4, 2), 64 + 3 * 25, 64 + 25),
        (WindowGrid(96, Fraction(57), Fraction(19), Fraction(0), 3, 4), 64 + 2 * 38, 64 + 3 * 38),
        (WindowGrid(43, Fraction(43, 8), Fraction(0), Fraction(9), 9, 5), 64 + 8 * 8, 64 + 4 * 8),
    ],
    ids=["a cell", "one window", "half pixels", "third pixels", "an odd size"],
)
def test_a_strip_reaches_from_the_first_window_to_the_last(
    grid: WindowGrid, width: int, height: int
) -> None:
    strip = Strip(grid, SEED_FEATURES).cut(FramePyramid(FRAME))
    assert strip.shape == (height, width, 3)
    assert strip.dtype == np.uint8


@pytest.mark.parametrize(("size", "step"), [(64, 8), (64, 12), (128, 16), (128, 50), (32, 12)])
@pytest.mark.parametrize("color_space", ["YCrCb", "HLS"])
def test_a_window_lies_at_its_place_in_the_frame_times_patch_over_size(
    size: int, step: int, color_space: str
) -> None:
    features = FeatureSettings.model_validate(
        {"patch": 64, "color_space": color_space, "hog": HogSettings(cell=8)}
    )
    grid = WindowGrid(size, Fraction(step), Fraction(6), Fraction(11), 4, 3)
    strip = Strip(grid, features).cut(FramePyramid(FRAME))
    for i, (x, y, w, h) in enumerate(grid.boxes.tolist()):
        row, column = divmod(i, grid.columns)
        left, top = column * step * 64 // size, row * step * 64 // size
        patch = convert(to_patch(FRAME[y : y + h, x : x + w], 64), features)
        inner = np.s_[1:-1, 1:-1]  # enlarging looks beyond the edge
        ours = strip[top : top + 64, left : left + 64]
        assert levels_apart(ours[inner], patch[inner], color_space).max() <= 1


def levels_apart(ours: Image, other: Image, color_space: str) -> npt.NDArray[np.int64]:
    """Return how far values are apart; hue, the first channel of HLS, goes round at 180.

    OpenCV's conversion of a crop and of its frame may differ by one level: vectorised code rounds
    otherwise than the code for the last few pixels of a row.
    """
    apart = abs(ours.astype(np.int64) - other)
    if color_space == "HLS":
        apart[..., 0] = np.minimum(apart[..., 0], 180 - apart[..., 0])
    return apart
