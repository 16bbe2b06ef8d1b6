import cv2
import numpy as np
import pytest

from vdet.config.schema import HeatSettings
from vdet.geometry import Box
from vdet.heatmap import Heat, HeatMap, find_regions
from vdet.windows import Windows


def found(*windows: tuple[int, int, int, int, float]) -> Windows:
    boxes = np.array([window[:4] for window in windows], np.int32).reshape(-1, 4)
    return Windows(boxes, np.array([window[4] for window in windows], np.float32))


def heat_map(frames: int = 2, blur: int = 0) -> HeatMap:
    return HeatMap(100, 60, HeatSettings(frames=frames, blur=blur))


def drawn(*boxes: tuple[int, int, int, int, float]) -> Heat:
    heat = np.zeros((60, 100), np.float32)
    for x, y, width, height, value in boxes:
        heat[y : y + height, x : x + width] = value
    return heat


def test_heat_is_the_sum_of_the_probabilities_of_the_windows_over_a_pixel() -> None:
    heat = heat_map().update(found((10, 10, 20, 20, 0.5), (20, 20, 20, 20, 0.75)))
    assert heat.shape == (60, 100)
    assert heat.dtype == np.float32
    assert heat[10, 10] == 0.5
    assert heat[25, 25] == 1.25
    assert heat[39, 39] == 0.75
    assert heat[40, 39] == heat[39, 40] == heat[9, 10] == 0
    assert heat.sum() == 400 * 0.5 + 400 * 0.75


def test_heat_is_summed_over_the_last_frames_and_the_oldest_is_forgotten() -> None:
    heat = heat_map(frames=3)
    peaks = [float(heat.update(found((0, 0, 5, 5, p))).max()) for p in (0.5, 0.25, 1, 0.125)]
    assert peaks == [0.5, 0.75, 1.75, 1.375]


def test_frames_without_detections_cool_the_map_down() -> None:
    heat = heat_map(frames=2)
    heat.update(found((0, 0, 5, 5, 1)))
    assert heat.update(found()).max() == 1
    assert heat.update(found()).max() == 0


def test_a_returned_map_does_not_change_with_later_frames() -> None:
    heat = heat_map()
    first = heat.update(found((0, 0, 5, 5, 1)))
    heat.update(found((0, 0, 5, 5, 1)))
    assert first.max() == 1


def test_blur_spreads_heat_and_conserves_it() -> None:
    window = found((40, 20, 20, 20, 1))
    sharp, blurred = heat_map().update(window), heat_map(blur=15).update(window)
    assert blurred.sum() == pytest.approx(sharp.sum(), rel=1e-5)
    assert 0 < blurred[30, 35] < 1
    np.testing.assert_allclose(blurred, cv2.GaussianBlur(sharp, (15, 15), 0), atol=1e-6)


def test_blur_is_of_the_sum_not_of_what_is_kept() -> None:
    heat = heat_map(frames=2, blur=9)
    heat.update(found((40, 20, 20, 20, 1)))
    twice = heat.update(found((40, 20, 20, 20, 1)))
    once = heat_map(blur=9).update(found((40, 20, 20, 20, 1)))
    np.testing.assert_allclose(twice, 2 * once, atol=1e-6)


def test_an_even_blur_is_rounded_up_to_the_next_odd_one() -> None:
    window = found((40, 20, 20, 20, 1))
    np.testing.assert_array_equal(
        heat_map(blur=14).update(window), heat_map(blur=15).update(window)
    )


@pytest.mark.parametrize("blur", [0, 1])
def test_a_blur_of_a_pixel_or_none_changes_nothing(blur: int) -> None:
    assert heat_map(blur=blur).update(found((0, 0, 9, 9, 1))).sum() == 81


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
def test_of_a_window_partly_outside_the_frame_only_the_inside_is_heated(
    window: tuple[int, int, int, int], pixels: int
) -> None:
    assert heat_map().update(found((*window, 1))).sum() == pixels


def test_a_drawn_rectangle_gives_its_box_its_middle_and_its_peak() -> None:
    heat = drawn((20, 10, 31, 21, 2))
    heat[15, 30] = 5
    (region,) = find_regions(heat, 1.4)
    assert region.box == Box(20, 10, 31, 21)
    assert region.centroid == pytest.approx((35, 20))
    assert region.peak == 5


def test_each_region_has_its_own_peak() -> None:
    regions = find_regions(drawn((50, 5, 10, 10, 2), (5, 30, 10, 10, 3)), 1)
    assert [(region.box, region.peak) for region in regions] == [
        (Box(50, 5, 10, 10), 2.0),
        (Box(5, 30, 10, 10), 3.0),
    ]


def test_regions_come_topmost_first_and_then_leftmost() -> None:
    heat = drawn((60, 5, 4, 4, 2), (5, 5, 4, 4, 2), (30, 40, 4, 4, 2), (2, 20, 4, 4, 2))
    corners = [(region.box.x, region.box.y) for region in find_regions(heat, 1)]
    assert corners == [(5, 5), (60, 5), (2, 20), (30, 40)]


def test_heat_equal_to_the_threshold_is_not_hot() -> None:
    heat = drawn((10, 10, 10, 10, 1.5))
    assert find_regions(heat, 1.5) == []
    assert len(find_regions(heat, 1.4999)) == 1


def test_a_cold_map_has_no_regions() -> None:
    assert find_regions(drawn(), 0) == []


def test_a_hole_does_not_split_a_region() -> None:
    (region,) = find_regions(drawn((20, 10, 30, 30, 2), (30, 20, 10, 10, 0)), 1)
    assert region.box == Box(20, 10, 30, 30)
    assert region.centroid == pytest.approx((34.5, 24.5))
    assert region.peak == 2


def test_what_lies_in_the_box_but_not_in_the_region_does_not_count_for_its_peak() -> None:
    # an L around a hotter spot that does not touch it
    heat = drawn((10, 10, 5, 40, 2), (10, 45, 40, 5, 2), (30, 15, 5, 5, 9))
    peaks = {region.box: region.peak for region in find_regions(heat, 1)}
    assert peaks == {Box(10, 10, 40, 40): 2.0, Box(30, 15, 5, 5): 9.0}


def test_a_single_pixel_is_a_region_with_its_middle() -> None:
    (region,) = find_regions(drawn((7, 9, 1, 1, 3)), 1)
    assert region.box == Box(7, 9, 1, 1)
    assert region.centroid == (7.5, 9.5)
    assert region.peak == 3


def test_a_line_is_a_region_with_the_middle_of_its_box() -> None:
    (region,) = find_regions(drawn((10, 9, 20, 1, 3)), 1)
    assert region.box == Box(10, 9, 20, 1)
    assert region.centroid == (20, 9.5)


def test_pixels_that_touch_at_a_corner_are_connected() -> None:
    (region,) = find_regions(drawn((10, 10, 5, 5, 2), (15, 15, 5, 5, 2)), 1)
    assert region.box == Box(10, 10, 10, 10)


def test_a_region_at_the_border_of_the_frame_is_whole() -> None:
    (region,) = find_regions(drawn((0, 0, 100, 60, 2)), 1)
    assert region.box == Box(0, 0, 100, 60)
