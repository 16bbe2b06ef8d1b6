"""The shipped network: it loads, fits the limits on size, and finds drawn vehicles."""

import numpy as np
import pytest

from vdet.config.schema import NetworkSettings
from vdet.detect.factory import load_detector
from vdet.detect.onnx.detector import SHIPPED
from vdet.detect.onnx.recognition import recognize
from vdet.detect.onnx.session import Session
from vdet.detect.protocol import stage_pictures_of
from vdet.media import Picture
from vdet.testing import check_detector

MAX_BYTES = 2_500_000
SIZES = [(1280, 720), (640, 480), (1242, 375), (270, 480), (64, 64)]


def test_it_is_small() -> None:
    assert SHIPPED.stat().st_size <= MAX_BYTES


def test_its_header_tells_its_form_and_it_need_not_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(Session, "run")
    assert recognize(Session(SHIPPED)).name == "vdet"


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_it_passes_the_checks_of_detectors_in_frames_of_any_shape(width: int, height: int) -> None:
    rng = np.random.default_rng(0)
    images = [rng.integers(0, 256, (height, width, 3), np.uint8) for _ in range(2)]
    check_detector(load_detector(NetworkSettings()), images)


def test_a_still_picture_has_a_larger_input_than_a_frame() -> None:
    detector = load_detector(NetworkSettings()).for_video(1280, 720, [])
    image = np.zeros((720, 1280, 3), np.uint8)
    inputs = []
    for index in (0, None):
        detections = detector.detect(detector.search(Picture(image), index))
        inputs.append(stage_pictures_of(detector)(image, detections)["input"].shape)
    assert inputs == [(352, 640, 3), (416, 768, 3)]


def test_it_says_which_classes_it_does_not_know() -> None:
    def unknown(*classes: str) -> tuple[str, ...]:
        model = load_detector(NetworkSettings(classes=classes))
        return getattr(model.for_video(640, 360, []), "unknown_classes", ("?",))

    assert unknown("car", "tram") == ("tram",)
    assert unknown(*NetworkSettings().classes) == ()
