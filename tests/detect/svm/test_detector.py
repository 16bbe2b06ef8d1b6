import numpy as np
import pytest

from red_cars import CAR, HEIGHT, PERSPECTIVE, SETTINGS, WIDTH, by_perspective, red_finder, road
from vdet.config.schema import MotionSettings, Settings
from vdet.detect.svm.detector import Detection, Detector, detect_still, horizon_of, still_boxes
from vdet.errors import ImageError
from vdet.geometry import Box
from vdet.media.images import Image

MODEL = red_finder()


def watch(*images: Image, settings: Settings = SETTINGS) -> list[Detection]:
    """Give the detections in consecutive frames."""
    horizon = settings.search.perspective.horizon
    detector = Detector(MODEL, settings, WIDTH, HEIGHT, horizon=horizon)
    return [detector.accumulate(detector.search(image, i)) for i, image in enumerate(images)]


def but(settings: Settings, room: str, **changes: object) -> Settings:
    """Replace some settings of a room."""
    section = getattr(settings, room).model_copy(update=changes)
    return settings.model_copy(update={room: section})


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
    expected = detection.windows.probabilities >= SETTINGS.search.probability
    assert 0 < expected.sum() < len(detection.windows)
    np.testing.assert_array_equal(detection.hits.boxes, detection.windows.boxes[expected])


def test_only_hits_make_heat() -> None:
    (detection,) = watch(road(CAR), settings=but(SETTINGS, "search", probability=1.0))
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
    settings = but(SETTINGS, "heat", frames=frames)
    *_, video = watch(*[road(CAR)] * frames, settings=settings)
    still = detect_still(MODEL, settings, road(CAR))
    np.testing.assert_allclose(still.heat.values, video.heat.values)
    assert [region.box for region in still.regions] == [region.box for region in video.regions]


def test_a_coarser_heat_finds_the_same_car() -> None:
    fine = but(SETTINGS, "heat", weight="coverage", shrink=1, threshold=0.7)
    coarse = but(fine, "heat", shrink=Settings().heat.shrink)
    (expected,) = detect_still(MODEL, fine, road(CAR)).regions
    (region,) = detect_still(MODEL, coarse, road(CAR)).regions
    assert expected.box.iou(CAR) > 0.5
    assert region.box.iou(expected.box) > 0.8
    assert region.peak == pytest.approx(expected.peak, rel=0.05)


class TestTheDefaultsWay:
    """Sets that follow the perspective, taken in turns; boxes from votes."""

    def test_a_car_is_found_where_it_is(self) -> None:
        (region,) = detect_still(MODEL, PERSPECTIVE, road(CAR)).regions
        assert region.box.iou(CAR) > 0.6
        assert region.box.contains(region.centroid)

    def test_two_cars_that_one_hot_region_covers_are_told_apart(self) -> None:
        cars = CAR.moved_to(60, 120), CAR.moved_to(156, 120)  # half a car between them
        image = road(*cars)
        outlines = detect_still(MODEL, but(PERSPECTIVE, "heat", regions="outline"), image).regions
        assert len(outlines) == 1
        voted = detect_still(MODEL, PERSPECTIVE, image).regions
        assert len(voted) == 2
        for car in cars:
            assert max(region.box.iou(car) for region in voted) > 0.6

    def test_every_frame_is_searched_at_the_sets_whose_turn_it_is(self) -> None:
        found = watch(*[road()] * 4, settings=PERSPECTIVE)
        sizes = [np.unique(detection.windows.boxes[:, 2]).tolist() for detection in found]
        assert sizes == [[48], [64], [48], [64]]
        assert [grid.size for grid in found[0].grids] == [48, 64]

    @pytest.mark.parametrize("alternate", [1, 2])
    def test_a_still_is_as_hot_as_a_video_that_stands_still(self, alternate: int) -> None:
        settings = but(PERSPECTIVE, "search", alternate=alternate)
        *_, video = watch(*[road(CAR)] * 4, settings=settings)
        still = detect_still(MODEL, settings, road(CAR))
        np.testing.assert_allclose(still.heat.values, video.heat.values, atol=1e-6)
        assert [each.box for each in still.regions] == [each.box for each in video.regions]
        one, other = ([region.peak for region in each.regions] for each in (still, video))
        np.testing.assert_allclose(one, other)

    def test_the_windows_of_a_still_are_all_of_them(self) -> None:
        detection = detect_still(MODEL, PERSPECTIVE, road(CAR))
        assert len(detection.windows) == sum(len(grid) for grid in detection.grids)
        assert set(detection.hits.boxes[:, 2].tolist()) == {48, 64}

    @pytest.mark.parametrize("x", [-32, WIDTH - 32])
    def test_a_car_half_beyond_the_side_is_found_and_its_box_ends_there(self, x: int) -> None:
        seen = CAR.moved_to(x, 120).clipped(WIDTH, HEIGHT)
        (region,) = detect_still(MODEL, PERSPECTIVE, road(seen)).regions
        assert region.box.clipped(WIDTH, HEIGHT) == region.box
        assert region.box.iou(seen) > 0.4

    def test_votes_of_frames_that_are_forgotten_are_not_heard(self) -> None:
        *_, detection = watch(road(CAR), road(CAR), road(), road(), settings=PERSPECTIVE)
        assert detection.regions == ()

    def test_an_empty_road_has_no_regions(self) -> None:
        assert detect_still(MODEL, PERSPECTIVE, road()).regions == ()


class TestHorizon:
    def test_that_is_set_is_taken(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("vdet.detect.svm.detector.find_horizon", pytest.fail)
        assert horizon_of(PERSPECTIVE, [road()]) == 0.35

    def test_is_looked_for_in_the_pictures_otherwise(self, monkeypatch: pytest.MonkeyPatch) -> None:
        images = [road(), road(CAR)]
        found = {id(images): 0.4}  # in these pictures and no others
        monkeypatch.setattr("vdet.detect.svm.detector.find_horizon", lambda asked: found[id(asked)])
        assert horizon_of(Settings(), images) == 0.4

    def test_of_a_still_is_its_own(self, monkeypatch: pytest.MonkeyPatch) -> None:
        for horizon in (0.35, 0.45):
            monkeypatch.setattr("vdet.detect.svm.detector.find_horizon", lambda _, h=horizon: h)
            first = detect_still(MODEL, by_perspective(0), road(CAR)).grids[0]
            assert float(first.top) == pytest.approx(horizon * HEIGHT - 0.1 * first.size, abs=1)


def test_lengths_scale_with_the_frame() -> None:
    image = np.repeat(np.repeat(road(CAR), 2, axis=0), 2, axis=1)
    (small,) = detect_still(MODEL, SETTINGS, road(CAR)).regions
    (large,) = detect_still(MODEL, SETTINGS, image).regions
    doubled = Box(2 * small.box.x, 2 * small.box.y, 2 * small.box.width, 2 * small.box.height)
    assert large.box.iou(doubled) > 0.9


class TestBoxesOfAStill:
    """Regions that the tracker would show, were this a video."""

    def test_by_the_rules_a_region_is_large_enough_both_ways(self) -> None:
        detection = detect_still(MODEL, SETTINGS, road(CAR))
        (region,) = detection.regions
        least = min(region.box.width, region.box.height)
        enough, too_much = (but(SETTINGS, "tracker", min_region=n) for n in (least, least + 1))
        assert still_boxes(detection, enough, WIDTH, HEIGHT) == [(region.box, region.peak)]
        assert still_boxes(detection, too_much, WIDTH, HEIGHT) == []

    def test_by_motion_a_region_is_wide_enough_and_clearly_seen(self) -> None:
        detection = detect_still(MODEL, PERSPECTIVE, road(CAR))
        (region,) = detection.regions
        share, peak = region.box.width / WIDTH, region.peak
        for smallest, still, boxes in (
            (share, 0.5, [(region.box, peak)]),
            (share + 1 / WIDTH, 0.5, []),
            (share, 0.51, []),
        ):
            motion = MotionSettings(smallest=smallest, strong=2 * peak, still=still)
            settings = but(PERSPECTIVE, "tracker", motion=motion)
            assert still_boxes(detection, settings, WIDTH, HEIGHT) == boxes

    @pytest.mark.parametrize("settings", [SETTINGS, PERSPECTIVE], ids=["rules", "motion"])
    def test_the_least_size_of_a_region_scales_with_the_frame(self, settings: Settings) -> None:
        detection = detect_still(MODEL, settings, road(CAR))
        assert len(still_boxes(detection, settings, WIDTH, HEIGHT)) == 1
        assert still_boxes(detection, settings, 10 * WIDTH, 10 * HEIGHT) == []


@pytest.mark.parametrize("shape", [(240, 20, 3), (1, 1, 3), (2, 2, 3)])
def test_a_picture_too_small_to_search_is_refused(shape: tuple[int, int, int]) -> None:
    with pytest.raises(ImageError, match="no search window fits"):
        detect_still(MODEL, SETTINGS, np.zeros(shape, np.uint8))


@pytest.mark.parametrize("value", [0, 128, 255])
def test_a_picture_of_one_colour_is_searched_without_complaint(value: int) -> None:
    image = np.full((240, 320, 3), value, np.uint8)
    assert len(detect_still(MODEL, SETTINGS, image).windows) > 0
