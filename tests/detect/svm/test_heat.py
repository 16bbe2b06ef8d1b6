from dataclasses import replace

import cv2
import numpy as np
import pytest

from vdet.boxes import Box
from vdet.config.kinds import HeatSettings, WindowSettings
from vdet.detect.svm.detector import Heat, find_regions, sum_heat
from vdet.detect.svm.windows import Windows, band_grid


def found(*windows: tuple[int, int, int, int, float], weight: float = 1) -> Windows:
    boxes = np.array([window[:4] for window in windows], np.int32).reshape(-1, 4)
    probabilities = np.array([window[4] for window in windows], np.float32)
    weights = np.full(len(windows), weight, np.float32)
    return Windows(boxes, probabilities, weights, boxes.astype(np.float32))


def heat_of(
    *frames: Windows, votes: float | None = None, size: tuple[int, int] = (100, 60)
) -> Heat:
    """Return the heat of frames; those of 60 rows are not blurred."""
    return sum_heat(frames, size, HeatSettings(votes=votes))


def drawn(*boxes: tuple[int, int, int, int, float], shrink: int = 1) -> Heat:
    """Draw a map of 100 × 60 values."""
    values = np.zeros((60, 100), np.float32)
    for x, y, width, height, value in boxes:
        values[y : y + height, x : x + width] = value
    return Heat(values, shrink)


def test_heat_is_the_sum_of_the_probabilities_of_the_windows_over_a_pixel() -> None:
    heat = heat_of(found((10, 10, 20, 20, 0.5), (20, 20, 20, 20, 0.75))).values
    assert heat.shape == (60, 100)
    assert heat.dtype == np.float32
    assert heat[10, 10] == 0.5
    assert heat[25, 25] == 1.25
    assert heat[39, 39] == 0.75
    assert heat[40, 39] == heat[39, 40] == heat[9, 10] == 0
    assert heat.sum() == 400 * 0.5 + 400 * 0.75


def test_blur_spreads_heat_and_conserves_it() -> None:
    window = found((40, 20, 20, 20, 1))
    sharp = np.zeros((720, 100), np.float32)
    sharp[20:40, 40:60] = 1
    blurred = heat_of(window, size=(100, 720)).values
    assert blurred.sum() == pytest.approx(sharp.sum(), rel=1e-5)
    np.testing.assert_allclose(blurred, cv2.GaussianBlur(sharp, (15, 15), 0), atol=1e-6)


@pytest.mark.parametrize(
    ("window", "pixels"),
    [
        ((-5, -5, 10, 10), 25),
        ((95, 55, 10, 10), 25),
        ((-20, 0, 10, 10), 0),
        ((0, -20, 10, 10), 0),
        ((100, 0, 10, 10), 0),
    ],
)
def test_a_hit_partly_outside_the_frame_heats_the_inside(
    window: tuple[int, int, int, int], pixels: int
) -> None:
    assert heat_of(found((*window, 1))).values.sum() == pixels


def test_with_votes_a_hit_adds_its_probability_times_its_weight() -> None:
    quarters = found((8, 8, 20, 20, 0.5), (20, 20, 20, 20, 1), weight=0.25)
    values = heat_of(quarters, votes=0.1).values
    assert (values[2, 2], values[6, 6], values[9, 9]) == (0.125, 0.375, 0.25)


@pytest.mark.parametrize("overlap", [0, 0.5, 0.75])
def test_with_votes_heat_does_not_depend_on_overlap(overlap: float) -> None:
    settings = WindowSettings(size=20, overlap=overlap, top=0, bottom=60)
    grid = band_grid(settings, 100, 60)
    weights = np.full(len(grid), grid.weight, np.float32)
    ones, boxes = np.ones(len(grid), np.float32), grid.boxes
    windows = Windows(boxes, ones, weights, boxes.astype(np.float32))
    assert heat_of(windows, votes=0.1).values[7, 12] == pytest.approx(1)


def test_a_hit_heats_its_vehicle_and_not_its_window() -> None:
    window = found((10, 10, 20, 20, 0.5))
    shown = replace(window, vehicles=np.array([[14, 12, 30, 10]], np.float32))
    expected = heat_of(found((14, 12, 30, 10, 0.5)))
    np.testing.assert_array_equal(heat_of(shown).values, expected.values)


def test_with_votes_a_value_stands_for_4_by_4_pixels() -> None:
    window = found((16, 8, 32, 24, 0.5))
    heat = heat_of(window, votes=0.1)
    assert heat.shrink == 4
    expected = np.zeros((15, 25), np.float32)
    expected[2:8, 4:12] = 0.5
    np.testing.assert_array_equal(heat.values, expected)
    blurred = heat_of(window, votes=0.1, size=(100, 1152)).values[:15]  # 24 / 4, made odd
    np.testing.assert_allclose(blurred, cv2.GaussianBlur(expected, (7, 7), 0), atol=1e-6)


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
    assert region.box == Box.sized(20, 10, 30, 30)
    assert region.centroid == pytest.approx((34.5, 24.5))
    assert region.strength == 2


def test_the_strength_is_the_peak_of_the_region_and_not_of_its_box() -> None:
    # an L around a hotter spot that it does not touch
    heat = drawn((10, 10, 5, 40, 2), (10, 45, 40, 5, 2), (30, 15, 5, 5, 9))
    peaks = {region.box: region.strength for region in find_regions(heat, 1)}
    assert peaks == {Box.sized(10, 10, 40, 40): 2.0, Box.sized(30, 15, 5, 5): 9.0}
