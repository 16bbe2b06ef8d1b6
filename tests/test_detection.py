import numpy as np
import pytest

from red_cars import CAR, HEIGHT, SETTINGS, WIDTH, red_finder, road
from vdet.config.schema import HeatSettings, Settings, TrackerSettings
from vdet.detection import Detection, Detector, detect_still, still_boxes
from vdet.errors import ImageError
from vdet.geometry import Box
from vdet.images import Image

MODEL = red_finder()


def watch(*images: Image, settings: Settings = SETTINGS) -> list[Detection]:
    """Give the detections in consecutive frames."""
    detector = Detector(MODEL, settings, WIDTH, HEIGHT)
    return [detector.accumulate(detector.search(image)) for image in images]


def test_a_car_in_consecutive_frames_becomes_a_region_around_it() -> None:
    *_, detection = watch(road(CAR), road(CAR))
    (region,) = detection.regions
    assert region.box.intersection(CAR) == CAR
    assert region.box.iou(CAR) > 0.35
    assert region.peak == detection.heat.peak > 1.4


def test_the_first_frame_alone_is_half_as_hot_as_two() -> None:
    first, second = watch(road(CAR), road(CAR))
    np.testing.assert_allclose(second.heat.values, 2 * first.heat.values, rtol=1e-5)


def test_the_heat_of_a_car_that_has_gone_is_forgotten() -> None:
    *_, detection = watch(road(CAR), road(), road())
    assert detection.heat.peak == 0
    assert detection.regions == ()


def test_hits_are_the_windows_of_at_least_the_probability() -> None:
    (detection,) = watch(road(CAR))
    expected = detection.windows.probabilities >= 0.5
    assert 0 < expected.sum() < len(detection.windows)
    np.testing.assert_array_equal(detection.hits.boxes, detection.windows.boxes[expected])


def test_only_hits_make_heat() -> None:
    strict = SETTINGS.model_copy(
        update={"search": SETTINGS.search.model_copy(update={"probability": 1.0})}
    )
    (detection,) = watch(road(CAR), settings=strict)
    assert len(detection.hits) == 0
    assert detection.heat.peak == 0


def test_an_empty_road_has_no_regions() -> None:
    detection = detect_still(MODEL, SETTINGS, road())
    assert detection.regions == ()
    assert detection.heat.values.shape == (240, 320)


def test_two_cars_apart_are_two_regions() -> None:
    detection = detect_still(MODEL, SETTINGS, road(CAR, CAR.moved_to(224, 120)))
    assert [region.box.x < 190 for region in detection.regions] == [True, False]


@pytest.mark.parametrize("frames", [1, 2, 5])
def test_a_still_is_as_hot_as_a_video_that_stands_still(frames: int) -> None:
    heat = SETTINGS.heat.model_copy(update={"frames": frames})
    settings = SETTINGS.model_copy(update={"heat": heat})
    *_, video = watch(*[road(CAR)] * frames, settings=settings)
    still = detect_still(MODEL, settings, road(CAR))
    np.testing.assert_allclose(still.heat.values, video.heat.values)
    assert [region.box for region in still.regions] == [region.box for region in video.regions]


def test_the_default_heat_finds_the_same_car_in_coarser_pixels() -> None:
    fine = SETTINGS.model_copy(update={"heat": HeatSettings(shrink=1, threshold=2)})
    coarse = SETTINGS.model_copy(update={"heat": HeatSettings(threshold=2)})
    (expected,) = detect_still(MODEL, fine, road(CAR)).regions
    (region,) = detect_still(MODEL, coarse, road(CAR)).regions
    assert expected.box.iou(CAR) > 0.5
    assert region.box.iou(expected.box) > 0.8
    assert region.peak == pytest.approx(expected.peak, rel=0.05)


def test_lengths_scale_with_the_frame() -> None:
    image = np.repeat(np.repeat(road(CAR), 2, axis=0), 2, axis=1)
    (small,) = detect_still(MODEL, SETTINGS, road(CAR)).regions
    (large,) = detect_still(MODEL, SETTINGS, image).regions
    doubled = Box(2 * small.box.x, 2 * small.box.y, 2 * small.box.width, 2 * small.box.height)
    assert large.box.iou(doubled) > 0.9


def test_regions_too_small_for_the_tracker_are_no_boxes() -> None:
    detection = detect_still(MODEL, SETTINGS, road(CAR))
    (region,) = detection.regions
    width, height = region.box.width, region.box.height
    assert still_boxes(detection, SETTINGS, 240) == [(region.box, region.peak)]
    for least, boxes in ((min(width, height), 1), (min(width, height) + 1, 0)):
        settings = SETTINGS.model_copy(update={"tracker": TrackerSettings(min_region=least)})
        assert len(still_boxes(detection, settings, 240)) == boxes


def test_the_least_size_of_a_region_scales_with_the_frame() -> None:
    detection = detect_still(MODEL, SETTINGS, road(CAR))
    assert len(still_boxes(detection, SETTINGS, 240)) == 1
    assert still_boxes(detection, SETTINGS, 2400) == []


@pytest.mark.parametrize("shape", [(240, 20, 3), (1, 1, 3), (2, 2, 3)])
def test_a_picture_too_small_to_search_is_refused(shape: tuple[int, int, int]) -> None:
    with pytest.raises(ImageError, match="no search window fits"):
        detect_still(MODEL, SETTINGS, np.zeros(shape, np.uint8))


@pytest.mark.parametrize("value", [0, 128, 255])
def test_a_picture_of_one_colour_is_searched_without_complaint(value: int) -> None:
    image = np.full((240, 320, 3), value, np.uint8)
    assert len(detect_still(MODEL, SETTINGS, image).windows) > 0
