"""The shipped network: it loads, fits the limits on size, and finds drawn vehicles."""

from dataclasses import astuple

import numpy as np
import pytest

from vdet.boxes import iou_matrix
from vdet.config.schema import NetworkSettings
from vdet.detect.detectors import load_detector
from vdet.detect.onnx.detector import SHIPPED, NetworkDetector
from vdet.detect.onnx.network import Session, recognize
from vdet.media import Picture
from vdet.synthetic import Renderer, demo_scene, must_be_found, true_boxes
from vdet.testing import check_detector

MAX_BYTES = 4_000_000
FRAME = 40
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


def test_a_still_picture_is_also_searched_mirrored_with_a_larger_input() -> None:
    """Both searches find each drawn vehicle where it is."""
    scene = demo_scene(0)
    width, height = scene.camera.width, scene.camera.height
    detector = load_detector(NetworkSettings()).for_video(width, height, [])
    assert isinstance(detector, NetworkDetector)
    assert (detector.network.form.width, detector.larger.form.width) == (640, 896)
    boxes = [astuple(item.box) for item in true_boxes(scene, FRAME) if must_be_found(item, height)]
    searches, is_still = detector.search(Picture(Renderer(scene).image(FRAME)), None)
    assert (len(searches), is_still) == (2, True)
    for found in searches:
        overlap = iou_matrix(np.array(boxes), found.sides)
        assert (overlap.max(axis=1) > 0.7).all()


def test_a_warning_names_the_classes_it_does_not_have(caplog: pytest.LogCaptureFixture) -> None:
    load_detector(NetworkSettings())
    load_detector(NetworkSettings(classes=("car", "tram")))
    (message,) = caplog.messages
    assert message.endswith("net.onnx: lacks detector.classes tram")
