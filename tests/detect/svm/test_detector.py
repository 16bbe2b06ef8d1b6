"""What the linear model detects in drawn pictures and videos, and how the settings change it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boxing import moved_to, rounded
from red_cars import CAR, HEIGHT, SETTINGS, THREE_SETS, WIDTH, by_perspective, red_finder, road
from vdet.boxes import Box, Boxes, Float32Array
from vdet.config.schema import ScoreSettings, StillSettings, SvmSettings
from vdet.detect.svm.detector import SvmModel, horizon_of
from vdet.detect.svm.heat import HotRegion
from vdet.detect.svm.scores import detection_scores
from vdet.detect.svm.search import FrameSearch
from vdet.detect.svm.stages import Trace
from vdet.errors import FrameSizeError
from vdet.media import Picture
from vdet.media.images import Image

MODEL = red_finder()
ROWS = SETTINGS.svm
"""Window sets over fixed rows, outlines."""
DEFAULT = THREE_SETS.svm
"""Window sets by perspective, alternating; boxes from votes."""


def detect_video(*images: Image, settings: SvmSettings = ROWS) -> list[Boxes]:
    """Give the detections in consecutive frames of a video."""
    model = SvmModel(MODEL, settings)
    detector = model.for_video(WIDTH, HEIGHT, images[:1])
    return [detector.detect(detector.search(Picture(image), i)) for i, image in enumerate(images)]


def detect_still(image: Image, settings: SvmSettings = ROWS) -> Boxes:
    """Give the detections in a still picture."""
    height, width = image.shape[:2]
    detector = SvmModel(MODEL, settings).for_video(width, height, [image])
    return detector.detect(detector.search(Picture(image), None))


def trace_of(detections: Boxes) -> Trace:
    assert isinstance(detections.trace, Trace)
    return detections.trace


def but(settings: SvmSettings, section: str, **changes: Any) -> SvmSettings:
    """Replace some settings of a section."""
    changed = getattr(settings, section).model_copy(update=changes)
    return settings.model_copy(update={section: changed})


def test_a_car_in_consecutive_frames_is_detected_by_a_box_around_it() -> None:
    *_, detections = detect_video(road(CAR), road(CAR))
    (box,) = rounded(detections)
    assert box.intersection(CAR) == CAR
    assert box.iou(CAR) > 0.35
    assert detections.data["strength"].tolist() == pytest.approx([trace_of(detections).heat.peak])
    assert detections.data["strength"][0] > 1.4
    assert box.contains((detections.data["centroid"][0, 0], detections.data["centroid"][0, 1]))


def test_the_score_follows_from_the_strength_by_the_settings() -> None:
    settings = but(ROWS, "score", middle=1.7, slope=3.0)
    *_, detections = detect_video(road(CAR), road(CAR), settings=settings)
    assert len(detections) == 1
    np.testing.assert_array_equal(
        detections.scores, detection_scores(detections.data["strength"], settings.score)
    )


def test_the_first_frame_alone_is_half_as_hot_as_two() -> None:
    first, second = (trace_of(each).heat for each in detect_video(road(CAR), road(CAR)))
    np.testing.assert_allclose(second.values, 2 * first.values, rtol=1e-5)


def test_the_heat_of_a_car_that_has_gone_is_forgotten() -> None:
    *_, detections = detect_video(road(CAR), road(), road())
    assert trace_of(detections).heat.peak == 0
    assert len(detections) == 0


def test_hits_are_the_windows_of_at_least_the_probability() -> None:
    (detections,) = detect_video(road(CAR))
    windows, hits = trace_of(detections).windows, trace_of(detections).hits
    expected = windows.probabilities >= ROWS.search.probability
    assert 0 < expected.sum() < len(windows)
    np.testing.assert_array_equal(hits.boxes, windows.boxes[expected])


def test_only_hits_make_heat() -> None:
    (detections,) = detect_video(road(CAR), settings=but(ROWS, "search", probability=1.0))
    assert len(trace_of(detections).hits) == 0
    assert trace_of(detections).heat.peak == 0


def test_nothing_is_detected_on_an_empty_road() -> None:
    detections = detect_still(road())
    assert len(detections) == 0
    assert trace_of(detections).heat.values.shape == (240, 320)


def test_two_cars_apart_are_two_detections() -> None:
    boxes = rounded(detect_still(road(CAR, moved_to(CAR, 224, 120))))
    assert [box.x1 < 190 for box in boxes] == [True, False]


def test_a_coarser_heatmap_finds_the_same_car() -> None:
    fine = but(ROWS, "heat", weight="coverage", shrink=1, threshold=0.7)
    coarse = but(fine, "heat", shrink=SvmSettings().heat.shrink)
    expected, found = detect_still(road(CAR), fine), detect_still(road(CAR), coarse)
    (expected_box,), (box,) = rounded(expected), rounded(found)
    assert expected_box.iou(CAR) > 0.5
    assert box.iou(expected_box) > 0.8
    assert found.data["strength"][0] == pytest.approx(expected.data["strength"][0], rel=0.05)


def test_lengths_scale_with_the_frame() -> None:
    image = np.repeat(np.repeat(road(CAR), 2, axis=0), 2, axis=1)
    (small,) = rounded(detect_still(road(CAR)))
    (large,) = rounded(detect_still(image))
    doubled = Box.sized(2 * small.x1, 2 * small.y1, 2 * small.width, 2 * small.height)
    assert large.iou(doubled) > 0.9


class TestDefaultSettings:
    """Window sets that follow the perspective; boxes from votes."""

    def test_a_car_is_detected_where_it_is(self) -> None:
        detections = detect_still(road(CAR), DEFAULT)
        (box,) = rounded(detections)
        assert box.iou(CAR) > 0.6
        ((x, y),) = detections.data["centroid"].tolist()
        assert box.contains((x, y))

    def test_two_cars_that_one_hot_region_covers_are_told_apart(self) -> None:
        cars = moved_to(CAR, 60, 120), moved_to(CAR, 156, 120)  # half a car between them
        image = road(*cars)
        outlines = detect_still(image, but(DEFAULT, "heat", regions="outline"))
        assert len(outlines) == 1
        voted = rounded(detect_still(image, DEFAULT))
        assert len(voted) == 2
        for car in cars:
            assert max(box.iou(car) for box in voted) > 0.6

    @pytest.mark.parametrize("x", [-32, WIDTH - 32])
    def test_a_car_half_beyond_the_side_is_detected_and_its_box_ends_there(self, x: int) -> None:
        seen = moved_to(CAR, x, 120).clipped(WIDTH, HEIGHT)
        (box,) = rounded(detect_still(road(seen), DEFAULT))
        assert box.clipped(WIDTH, HEIGHT) == box
        assert box.iou(seen) > 0.4

    def test_votes_of_forgotten_frames_do_not_count(self) -> None:
        frames = DEFAULT.heat.frames
        before, car = [road(CAR)] * frames, moved_to(CAR, CAR.x1 + 8, CAR.y1)
        for now, count in ((road(), 0), (road(car), 1)):
            detections = detect_video(*before, *[now] * frames, settings=DEFAULT)
            expected = detect_video(*[road()] * frames, *[now] * frames, settings=DEFAULT)
            assert len(detections[frames - 1]) == 1
            assert len(detections[-1]) == count
            np.testing.assert_array_equal(detections[-1].sides, expected[-1].sides)
            np.testing.assert_array_equal(
                detections[-1].data["strength"], expected[-1].data["strength"]
            )

    def test_nothing_is_detected_on_an_empty_road(self) -> None:
        assert len(detect_still(road(), DEFAULT)) == 0


@pytest.mark.parametrize(("settings", "told"), [(ROWS, False), (DEFAULT, True)])
def test_the_horizon_is_told_where_windows_depend_on_it(
    settings: SvmSettings, told: bool, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level("INFO", "vdet"):
        SvmModel(MODEL, settings).for_video(WIDTH, HEIGHT, [road()])
    assert ("horizon" in caplog.text) == told


class TestStillPictures:
    """A still picture equals the last of `heat.frames` equal frames of a video."""

    @pytest.mark.parametrize(
        ("strength", "shown"), [(2.0, CAR), (0.5, Box.sized(104, 124, 30, 20))]
    )
    def test_of_boxes_in_one_another_the_strongest_is_shown(
        self, monkeypatch: pytest.MonkeyPatch, strength: float, shown: Box
    ) -> None:
        part = Box.sized(104, 124, 30, 20)
        assert part.intersection(CAR) == part
        regions = [HotRegion(CAR, CAR.center, strength), HotRegion(part, part.center, 1.0)]
        monkeypatch.setattr("vdet.detect.svm.detector.split_regions", lambda *_: regions)
        assert rounded(detect_still(road(CAR), DEFAULT)) == [shown]

    @pytest.mark.parametrize("frames", [1, 2, 5])
    def test_a_still_picture_is_as_hot_as_a_video_of_the_same_frame(self, frames: int) -> None:
        settings = but(ROWS, "heat", frames=frames)
        *_, video = detect_video(*[road(CAR)] * frames, settings=settings)
        still = detect_still(road(CAR), settings)
        np.testing.assert_allclose(trace_of(still).heat.values, trace_of(video).heat.values)
        assert rounded(still) == rounded(video)

    def test_by_votes_too_it_shows_what_the_video_shows(self) -> None:
        *_, video = detect_video(*[road(CAR)] * DEFAULT.heat.frames, settings=DEFAULT)
        still = detect_still(road(CAR), DEFAULT)
        assert rounded(still) == rounded(video)
        np.testing.assert_allclose(still.scores, video.scores, rtol=1e-5)
        for name, column in still.data.items():
            np.testing.assert_allclose(column, video.data[name], rtol=1e-5)

    @pytest.mark.parametrize("settings", [ROWS, DEFAULT], ids=["rows", "default"])
    def test_a_still_picture_is_searched_once(
        self, settings: SvmSettings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        calls = []
        search = FrameSearch.search

        def counted(self: FrameSearch, picture: Picture) -> Any:
            calls.append(picture)
            return search(self, picture)

        monkeypatch.setattr(FrameSearch, "search", counted)
        detect_still(road(CAR), but(settings, "heat", frames=6))
        assert len(calls) == 1

    def test_the_windows_of_a_still_picture_are_those_of_every_set(self) -> None:
        trace = trace_of(detect_still(road(CAR), DEFAULT))
        assert len(trace.windows) == sum(len(grid) for grid in trace.grids)
        assert set(trace.hits.boxes[:, 2].tolist()) == {48, 64, 80}

    @pytest.mark.parametrize("settings", [ROWS, DEFAULT], ids=["rows", "default"])
    def test_a_detection_is_shown_if_it_is_large_and_strong_enough(
        self, settings: SvmSettings
    ) -> None:
        everything = settings.model_copy(update={"stills": StillSettings(strength=0, width=0)})
        whole = detect_still(road(CAR), everything)
        (box,), (strength,) = rounded(whole), whole.data["strength"].tolist()
        width, height = box.width / WIDTH, box.height / HEIGHT
        least = StillSettings(strength=strength - 1e-4, width=width, height=height)
        for stills, shown in (
            (least, True),
            (least.model_copy(update={"strength": strength + 0.01}), False),
            (least.model_copy(update={"width": width + 1 / WIDTH}), False),
            (least.model_copy(update={"height": height + 1 / HEIGHT}), False),
        ):
            found = detect_still(road(CAR), settings.model_copy(update={"stills": stills}))
            assert rounded(found) == ([box] if shown else [])

    def test_the_least_size_is_a_share_of_the_picture(self) -> None:
        wide = np.hstack([road(CAR), road(), road(), road()])
        assert len(detect_still(wide, but(ROWS, "stills", width=0.0))) == 1
        assert len(detect_still(road(CAR))) == 1
        assert len(detect_still(wide)) == 0

    def test_weak_and_small_detections_are_left_out_of_still_pictures_only(self) -> None:
        settings = but(ROWS, "stills", strength=100.0)
        assert len(detect_still(road(CAR), settings)) == 0
        assert len(detect_video(road(CAR), road(CAR), settings=settings)[-1]) == 1


class TestHorizon:
    def test_a_horizon_in_the_settings_is_not_searched_for(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("vdet.detect.svm.detector.find_horizon", pytest.fail)
        assert horizon_of(DEFAULT, [road()]) == 0.35

    def test_the_horizon_is_not_searched_for_where_no_set_depends_on_it(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("vdet.detect.svm.detector.find_horizon", pytest.fail)
        horizon_of(ROWS, [road()])

    def test_the_horizon_is_found_in_the_pictures_otherwise(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        images = [road(), road(CAR)]
        found = {id(images): 0.4}  # in these pictures and no others
        monkeypatch.setattr("vdet.detect.svm.detector.find_horizon", lambda given: found[id(given)])
        assert horizon_of(SvmSettings(), images) == 0.4

    def test_each_still_picture_has_its_own_horizon(self, monkeypatch: pytest.MonkeyPatch) -> None:
        for horizon in (0.35, 0.45):
            monkeypatch.setattr("vdet.detect.svm.detector.find_horizon", lambda _, h=horizon: h)
            first = trace_of(detect_still(road(CAR), by_perspective(None, 0.15, 0.2).svm)).grids[0]
            assert float(first.top) == pytest.approx(horizon * HEIGHT - 0.1 * first.size, abs=1)


@pytest.mark.parametrize("shape", [(240, 20, 3), (1, 1, 3), (2, 2, 3)])
def test_a_picture_too_small_to_search_is_refused(shape: tuple[int, int, int]) -> None:
    with pytest.raises(FrameSizeError, match="no search window fits"):
        detect_still(np.zeros(shape, np.uint8))


@pytest.mark.parametrize("value", [0, 128, 255])
def test_a_picture_of_one_colour_is_searched_without_warnings(value: int) -> None:
    image = np.full((240, 320, 3), value, np.uint8)
    assert len(trace_of(detect_still(image)).windows) > 0


def test_a_picture_is_not_changed() -> None:
    image = road(CAR)
    detect_still(image)
    np.testing.assert_array_equal(image, road(CAR))


def test_one_loaded_model_serves_frames_of_any_size() -> None:
    model = SvmModel(replace(MODEL), DEFAULT)
    for width, height in ((WIDTH, HEIGHT), (2 * WIDTH, 2 * HEIGHT)):
        image = np.zeros((height, width, 3), np.uint8)
        detector, picture = model.for_video(width, height, [image]), Picture(image)
        assert len(detector.detect(detector.search(picture, 0))) == 0
        assert trace_of(detector.detect(detector.search(picture, 1))).heat.values.shape == (
            height // 4,
            width // 4,
        )


# What `detection_scores` makes of the strength of the evidence.
positive = st.floats(1e-6, 1e6)
slopes = st.floats(0.01, 100)


def scores_of(*strengths: float, middle: float = 0.3, slope: float = 2) -> Float32Array:
    settings = ScoreSettings(middle=middle, slope=slope)
    return detection_scores(np.array(strengths, np.float32), settings)


class TestScores:
    def test_half_of_the_boxes_with_the_middle_strength_are_vehicles(self) -> None:
        assert scores_of(0.3)[0] == pytest.approx(0.5)
        assert scores_of(5, middle=5, slope=7)[0] == pytest.approx(0.5)

    def test_the_score_is_a_sigmoid_of_the_logarithm_of_the_strength(self) -> None:
        strength, middle, slope = 0.7, 0.3, 2.5
        expected = 1 / (1 + np.exp(-slope * (np.log(strength) - np.log(middle))))
        assert scores_of(strength, middle=middle, slope=slope)[0] == pytest.approx(
            expected, rel=1e-6
        )

    @given(st.lists(st.floats(0, 2**100, width=32), min_size=2, max_size=20), positive, slopes)
    def test_stronger_evidence_never_has_a_lower_score(
        self, strengths: list[float], middle: float, slope: float
    ) -> None:
        scores = scores_of(*sorted(strengths), middle=middle, slope=slope)
        assert (np.diff(scores) >= 0).all()
        assert (scores >= 0).all()
        assert (scores <= 1).all()

    def test_no_evidence_has_the_score_0_and_much_evidence_a_score_near_1(self) -> None:
        for slope in (0.5, 2, 100):
            scores = scores_of(0, 1e-45, 1e38, slope=slope)
            assert scores.tolist() == [0, pytest.approx(0), pytest.approx(1)]

    def test_no_strengths_have_no_scores(self) -> None:
        assert scores_of().shape == (0,)
        assert scores_of().dtype == np.float32

    @given(st.floats(0, 2**127, width=32), positive, slopes)
    def test_no_strength_overflows_or_warns(
        self, strength: float, middle: float, slope: float
    ) -> None:
        (score,) = scores_of(strength, middle=middle, slope=slope)  # warnings are errors here
        assert np.isfinite(score)

    def test_every_setting_gives_finite_scores(self) -> None:
        for middle, slope in ((1e-300, 100), (1e6, 100), (1e6, 1e-300)):
            settings = ScoreSettings(middle=middle, slope=slope)
            assert np.isfinite(
                scores_of(0, 1e-3, 1, 1e6, middle=settings.middle, slope=slope)
            ).all()
