"""What the linear model detects in drawn pictures and videos, and how the settings change it."""

from typing import Any

import numpy as np
import pytest

from boxing import moved_to, rounded
from red_cars import CAR, HEIGHT, SETTINGS, THREE_SETS, WIDTH, by_perspective, red_finder, road
from vdet.boxes import Box, Boxes, Image
from vdet.config.schema import SvmSettings
from vdet.detect.svm.detector import Heat, SvmModel
from vdet.media import Picture

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


def heat_of(detections: Boxes) -> Heat:
    _, heat = detections.trace
    assert isinstance(heat, Heat)
    return heat


def but(settings: SvmSettings, section: str, **changes: Any) -> SvmSettings:
    """Replace some settings of a section."""
    changed = getattr(settings, section).model_copy(update=changes)
    return settings.model_copy(update={section: changed})


def test_a_car_in_consecutive_frames_is_detected_by_a_box_around_it() -> None:
    *_, detections = detect_video(road(CAR), road(CAR))
    (box,) = rounded(detections)
    assert box.intersection(CAR) == CAR
    assert box.iou(CAR) > 0.35
    assert detections.data["strength"].tolist() == pytest.approx([heat_of(detections).peak])
    assert detections.data["strength"][0] > 1.4
    assert box.contains((detections.data["centroid"][0, 0], detections.data["centroid"][0, 1]))


def test_an_empty_road_has_no_heat_and_that_of_a_car_that_has_gone_is_forgotten() -> None:
    *_, detections = detect_video(road(CAR), road(), road())
    assert heat_of(detections).values.shape == (240, 320)
    assert heat_of(detections).peak == 0
    assert len(detections) == 0


def test_lengths_scale_with_the_frame() -> None:
    image = np.repeat(np.repeat(road(CAR), 2, axis=0), 2, axis=1)
    (small,) = rounded(detect_still(road(CAR)))
    (large,) = rounded(detect_still(image))
    doubled = Box.sized(2 * small.x1, 2 * small.y1, 2 * small.width, 2 * small.height)
    assert large.iou(doubled) > 0.9


class TestDefaultSettings:
    """Window sets that follow the perspective; boxes from votes."""

    def test_two_cars_that_one_hot_region_covers_are_told_apart(self) -> None:
        cars = moved_to(CAR, 60, 120), moved_to(CAR, 156, 120)  # half a car between them
        image = road(*cars)
        outlines = detect_still(image, but(DEFAULT, "heat", votes=None))
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


class TestStillPictures:
    """A still picture equals the last of `heat.frames` equal frames of a video."""

    @pytest.mark.parametrize("frames", [1, 2, 5])
    def test_a_still_picture_is_as_hot_as_a_video_of_the_same_frame(self, frames: int) -> None:
        settings = but(ROWS, "heat", frames=frames)
        *_, video = detect_video(*[road(CAR)] * frames, settings=settings)
        still = detect_still(road(CAR), settings)
        np.testing.assert_allclose(heat_of(still).values, heat_of(video).values)
        assert rounded(still) == rounded(video)

    @pytest.mark.parametrize("settings", [ROWS, DEFAULT], ids=["rows", "default"])
    def test_a_detection_is_shown_if_it_is_large_and_strong_enough(
        self, settings: SvmSettings
    ) -> None:
        def still(score: float, width: float, height: float) -> Boxes:
            limits = {"min_score_still": score, "min_size_still": (width, height)}
            return detect_still(road(CAR), settings.model_copy(update=limits))

        whole = still(0, 0, 0)
        (box,), (score,) = rounded(whole), whole.scores.tolist()
        width, height = box.width / WIDTH, box.height / HEIGHT
        assert rounded(still(score - 1e-4, width, height)) == [box]
        assert len(still(score + 1e-4, width, height)) == 0
        assert len(still(score, width + 1 / WIDTH, height)) == 0
        assert len(still(score, width, height + 1 / HEIGHT)) == 0


class TestHorizon:
    UNSET = by_perspective(None, 0.15, 0.2).svm

    @staticmethod
    def reported(settings: SvmSettings, count: int, caplog: pytest.LogCaptureFixture) -> str:
        """Return the line of the log that is about the horizon, with its level."""
        with caplog.at_level("INFO", "vdet"):
            SvmModel(MODEL, settings).for_video(WIDTH, HEIGHT, [road()] * count)
        return "".join(f"{record.levelname} {record.message}" for record in caplog.records)

    def test_none_is_searched_for_where_no_window_set_depends_on_it(
        self, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
    ) -> None:
        monkeypatch.setattr("vdet.detect.svm.detector.find_horizon", pytest.fail)
        assert self.reported(ROWS, 5, caplog) == ""

    @pytest.mark.parametrize(("count", "level"), [(1, "INFO"), (5, "WARNING")])
    def test_a_video_without_one_warns_that_it_is_assumed(
        self, count: int, level: str, caplog: pytest.LogCaptureFixture
    ) -> None:
        line = self.reported(self.UNSET, count, caplog)
        assert line.startswith(f"{level} no horizon found: 0.58 of the hei")
        assert "set detector.search.perspective.horizon" in line
        assert "lies" not in line
