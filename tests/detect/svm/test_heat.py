"""Heat: what the hits of the last frames add up to, and the regions that are hot."""

from itertools import chain

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdet.boxes import Box
from vdet.config.kinds import HeatSettings
from vdet.detect.svm.detector import Heat, find_regions, sum_heat
from vdet.detect.svm.windows import Windows

Hit = tuple[int, int, int, int, float, float]
"""x, y, width and height of a vehicle, probability, and weight."""
SIZE = 100, 60
"""Of a frame that is too small to be blurred."""

numbers = st.integers(-40, 110)
hits = st.tuples(
    numbers, numbers, *[st.integers(1, 50)] * 2, *[st.sampled_from([0.25, 0.5, 1])] * 2
)


def windows_of(found: list[Hit]) -> Windows:
    """Return hits whose windows are elsewhere than their vehicles."""
    table = np.array(found, np.float32).reshape(-1, 6)
    probabilities, weights = table[:, 4:].T
    return Windows(np.zeros((len(table), 4), np.int32), probabilities, weights, table[:, :4])


@given(st.lists(st.lists(hits, max_size=4), max_size=3))
@pytest.mark.parametrize(("votes", "side"), [(None, 1), (0.1, 4)])
def test_heat_is_the_sum_of_what_each_hit_adds_where_its_vehicle_is(
    votes: float | None, side: int, frames: list[list[Hit]]
) -> None:
    """Its probability; with votes, that times its weight, in values of 4 × 4 pixels."""
    heat = sum_heat([windows_of(found) for found in frames], SIZE, HeatSettings(votes=votes))
    expected = np.zeros((SIZE[1] // side, SIZE[0] // side))
    for x, y, width, height, probability, weight in chain(*frames):
        left, top, right, bottom = (
            max(0, (end + side // 2) // side) for end in (x, y, x + width, y + height)
        )
        expected[top:bottom, left:right] += probability * (weight if votes else 1)
    assert heat.shrink == side
    assert heat.values.dtype == np.float32
    np.testing.assert_array_equal(heat.values, expected)


@pytest.mark.parametrize(("votes", "rows", "kernel"), [(None, 720, 15), (0.1, 1152, 7)])
def test_heat_of_larger_frames_is_blurred(votes: float | None, rows: int, kernel: int) -> None:
    found = windows_of([(40, 24, 20, 16, 1, 1)])
    blurred = sum_heat([found], (100, rows), HeatSettings(votes=votes))
    side = blurred.shrink
    sharp = np.zeros((rows // side, 100 // side), np.float32)
    sharp[24 // side : 40 // side, 40 // side : 60 // side] = 1
    expected = cv2.GaussianBlur(sharp, (kernel, kernel), 0)
    np.testing.assert_allclose(blurred.values, expected, atol=1e-6)


def drawn(*boxes: tuple[int, int, int, int, float], shrink: int = 1) -> Heat:
    """Draw a map of 100 × 60 values."""
    values = np.zeros((60, 100), np.float32)
    for x, y, width, height, value in boxes:
        values[y : y + height, x : x + width] = value
    return Heat(values, shrink)


@pytest.mark.parametrize("shrink", [1, 4])
def test_a_region_has_its_box_its_middle_and_its_peak_in_pixels_of_the_frame(shrink: int) -> None:
    (region,) = find_regions(drawn((5, 3, 4, 2, 2), (6, 3, 1, 1, 5), shrink=shrink), 1)
    assert region.box == Box.sized(5 * shrink, 3 * shrink, 4 * shrink, 2 * shrink)
    # the middles of the outermost values' pixels are at equal distance from it
    left, right = (5 + 0.5) * shrink - 0.5, (8 + 0.5) * shrink - 0.5
    top, bottom = (3 + 0.5) * shrink - 0.5, (4 + 0.5) * shrink - 0.5
    assert region.centroid == pytest.approx(((left + right) / 2, (top + bottom) / 2))
    assert region.strength == 5


def test_a_hole_does_not_split_a_region() -> None:
    (region,) = find_regions(drawn((20, 10, 30, 30, 2), (30, 20, 10, 10, 0)), 1)
    assert (region.box, region.strength) == (Box.sized(20, 10, 30, 30), 2)
    assert region.centroid == pytest.approx((34.5, 24.5))


def test_the_strength_is_the_peak_of_the_region_and_not_of_its_box() -> None:
    # an L around a hotter spot that it does not touch
    heat = drawn((10, 10, 5, 40, 2), (10, 45, 40, 5, 2), (30, 15, 5, 5, 9))
    peaks = {region.box: region.strength for region in find_regions(heat, 1)}
    assert peaks == {Box.sized(10, 10, 40, 40): 2.0, Box.sized(30, 15, 5, 5): 9.0}
