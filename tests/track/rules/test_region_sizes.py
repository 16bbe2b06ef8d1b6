import pytest

from seed import SEED, tracker_but
from vdet.detect.svm.heat import Region
from vdet.geometry import Box
from vdet.track.rules.regions import any_overlap, combine, is_about_size, is_good_size, large_enough

SETTINGS = SEED.tracker


def region(x: int, y: int, width: int, height: int, peak: float = 2.0) -> Region:
    box = Box(x, y, width, height)
    return Region(box, box.center, peak)


# Rule 1


@pytest.mark.parametrize(("width", "height"), [(49, 80), (80, 49), (0, 80), (1, 1)])
def test_a_region_narrower_or_lower_than_50_pixels_is_ignored(width: int, height: int) -> None:
    assert large_enough([region(10, 10, width, height)], 640, 360, SETTINGS) == []


def test_a_region_of_50_by_50_pixels_is_kept() -> None:
    kept = [region(10, 10, 50, 50)]
    assert large_enough(kept, 640, 360, SETTINGS) == kept


def test_the_least_size_is_a_setting() -> None:
    small = [region(10, 10, 30, 30)]
    assert large_enough(small, 640, 360, tracker_but(min_region=30)) == small
    assert large_enough(small, 640, 360, tracker_but(min_region=31)) == []


def test_what_lies_outside_the_frame_does_not_count() -> None:
    kept = large_enough(
        [region(-20, 10, 90, 60), region(600, 10, 80, 60), region(900, 10, 80, 60)],
        640,
        360,
        SETTINGS,
    )
    assert [r.box for r in kept] == [Box(0, 10, 70, 60)]


def test_an_empty_region_is_ignored_whatever_the_setting() -> None:
    empty = [region(10, 10, 0, 60), region(700, 10, 60, 60)]
    assert large_enough(empty, 640, 360, tracker_but(min_region=0)) == []


# Sizes of rules 4 and 7 to 10


@pytest.mark.parametrize(
    ("width", "car_width", "good"),
    [(100, 150, False), (101, 150, True), (200, 400, False), (201, 400, True), (150, 100, True)],
)
def test_good_size_is_over_two_thirds_of_the_car_or_over_200_pixels(
    width: int, car_width: int, good: bool
) -> None:
    assert is_good_size(Box(0, 0, width, 50), Box(0, 0, car_width, 99), SETTINGS) is good


def test_good_size_is_set_by_share_and_width() -> None:
    region, car = Box(0, 0, 90, 50), Box(0, 0, 150, 50)
    assert not is_good_size(region, car, SETTINGS)
    assert is_good_size(region, car, tracker_but(good_fraction=0.5))
    assert is_good_size(region, car, tracker_but(wide=89))


@pytest.mark.parametrize(("width", "about"), [(79, False), (80, True), (160, True), (161, False)])
def test_about_the_size_is_within_a_third_of_the_cars_width(width: int, about: bool) -> None:
    assert is_about_size(Box(0, 0, width, 50), Box(0, 0, 120, 90), SETTINGS) is about


def test_combined_regions_have_one_box_the_common_centroid_and_the_higher_peak() -> None:
    both = combine(region(0, 0, 60, 60, peak=2), region(100, 0, 20, 60, peak=5))
    assert both == Region(Box(0, 0, 120, 60), (50, 30), 5)


@pytest.mark.parametrize(
    ("x", "y", "overlap"), [(59, 59, True), (60, 59, False), (59, 60, False), (300, 300, False)]
)
def test_overlap_counts_across_and_down(x: int, y: int, overlap: bool) -> None:
    boxes = [Box(500, 500, 100, 100), Box(0, 0, 100, 100), Box(x, y, 100, 100)]
    assert any_overlap(boxes, 40) is overlap
