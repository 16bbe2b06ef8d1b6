"""The warning that the shipped linear model does not know a road."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from red_cars import NullDetector, red_finder
from vdet.boxes import NO_BOXES, Boxes, Image
from vdet.config.schema import SvmSettings
from vdet.detect.factory import load_detector, model_file
from vdet.detect.protocol import DetectorModel
from vdet.detect.svm.detector import SvmModel
from vdet.detect.svm.road_check import RoadCheck
from vdet.media import Picture
from vdet.media.images import read_image
from vdet.media.reader import VideoReader

PICTURE = Picture(np.zeros((100, 200, 3), np.uint8))
CARS = ((10, 10, 40, 30), (60, 10, 90, 30), (110, 10, 140, 30))
WARNING = "does not seem to know this road"


def boxes(*corners: tuple[int, int, int, int], score: float = 0.9) -> Boxes:
    return Boxes(np.reshape(corners, (-1, 4)), np.full(len(corners), score))


class Finds(NullDetector):
    """Another detector, which finds the same in every picture."""

    def __init__(self, found: Boxes) -> None:
        self._found = found

    def for_video(self, *_: object) -> "Finds":
        return self

    def detect(self, candidates: None) -> Boxes:  # noqa: ARG002
        return self._found


def test_a_model_that_misses_most_vehicles_warns_once(caplog: pytest.LogCaptureFixture) -> None:
    check = RoadCheck(lambda: Finds(boxes(*CARS)))
    check.compare(PICTURE, boxes(CARS[0]))  # 3 + 1 boxes are too few
    assert not caplog.records
    check.compare(PICTURE, NO_BOXES)
    assert f"{WARNING}: it agrees with the network on 29 % of the boxes" in caplog.text
    for _ in range(5):
        check.compare(PICTURE, NO_BOXES)
    assert len(caplog.records) == 1


def test_each_video_is_judged_for_itself_and_pictures_together() -> None:
    check = RoadCheck(lambda: Finds(boxes(*CARS)))
    model = SvmModel(red_finder(), SvmSettings(), check)
    image = PICTURE.image
    checks = [model.for_video(200, 100, [image] * count)._check for count in (1, 1, 2, 2)]
    assert [each is check for each in checks] == [True, True, False, False]
    assert checks[2] is not checks[3]


@pytest.mark.parametrize(
    "found",
    [
        boxes(*CARS),
        Boxes([*CARS, (150, 50, 190, 90)], [0.9, 0.9, 0.9, 0.3]),
        Boxes([*CARS, (150, 50, 158, 58)], [0.9] * 4),
    ],
    ids=["the same", "an unsure one more", "a narrow one more"],
)
def test_a_model_that_agrees_does_not_warn(found: Boxes, caplog: pytest.LogCaptureFixture) -> None:
    check = RoadCheck(lambda: Finds(boxes(*CARS)))
    for _ in range(5):
        check.compare(PICTURE, found)
    assert not caplog.records


def test_a_few_frames_of_a_long_video_are_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    other = Finds(NO_BOXES)
    compared: list[int] = []
    check = RoadCheck(lambda: other)
    for number in range(100):
        monkeypatch.setattr(Finds, "search", lambda *_, n=number: compared.append(n))
        check.compare(PICTURE, NO_BOXES)
    assert compared == [0, 1, 2, 4, 8, 16, 32, 64]


@pytest.mark.parametrize("is_still", [False, True])
def test_pictures_and_video_are_compared(caplog: pytest.LogCaptureFixture, is_still: bool) -> None:
    red = red_finder()
    check = RoadCheck(lambda: Finds(boxes((100, 200, 180, 260))))
    model = SvmModel(red, SvmSettings(features=red.features), check=check)
    image = np.full((360, 640, 3), 90, np.uint8)
    detector = model.for_video(640, 360, [image])
    for index in range(20):
        if is_still:
            detector = model.for_video(640, 360, [image])
        detector.detect(detector.search(Picture(image), None if is_still else index))
    assert caplog.text.count(WARNING) == 1


@pytest.mark.realdata
def test_the_shipped_model_knows_its_road_and_says_that_it_knows_no_other(
    real_data: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with VideoReader(real_data / "project_video.mp4", frames=500) as reader:
        images = [frame.image for frame in reader if frame.index % 60 == 0]
    search(load_detector(SvmSettings()), images)
    assert not caplog.records
    others = sorted((real_data.parent / "roads" / "us_dashcams").glob("*.jpg"))
    if not others:
        pytest.skip("pictures of other roads are not here")
    images = [read_image(path) for path in others]
    search(load_detector(SvmSettings()), images)
    assert caplog.text.count(WARNING) == 1
    caplog.clear()
    search(load_detector(SvmSettings(model=str(model_file(SvmSettings())))), images)
    assert not caplog.records, "a model that is given is taken to know the road"


def search(model: DetectorModel, images: Sequence[Image]) -> None:
    """Search still pictures."""
    for image in images:
        detector = model.for_video(image.shape[1], image.shape[0], [image])
        detector.detect(detector.search(Picture(image), None))
