"""Water on the windscreen: it is recognized, and vehicles behind it are detected."""

from dataclasses import astuple

import cv2
import numpy as np

from vdet.boxes import Image, iou_matrix
from vdet.config.schema import NetworkSettings
from vdet.detect.detectors import load_detector
from vdet.detect.onnx.water import WIDTH, is_wet
from vdet.media import Picture
from vdet.synthetic import Renderer, demo_scene, must_be_found, true_boxes

FRAME = 40


def with_drops(image: Image, count: int = 1500) -> Image:
    """Blur an image, and draw sharp drops over it: dark above, bright below."""
    rng = np.random.default_rng(1)
    height, width = image.shape[:2]
    wet = cv2.GaussianBlur(image, (0, 0), width / 200)
    for x, y, size in zip(
        rng.integers(0, width, count),
        rng.integers(0, height, count),
        rng.uniform(0.004, 0.008, count) * width,
        strict=True,
    ):
        cv2.ellipse(wet, ((int(x), int(y)), (size, size * 0.7), 0), (60, 60, 60), -1)
        cv2.ellipse(wet, ((int(x), int(y + size / 5)), (size, size / 3), 0), (210, 210, 210), -1)
    return np.asarray(wet, np.uint8)


def plane_of(image: Image) -> Image:
    size = WIDTH, round(image.shape[0] * WIDTH / image.shape[1])
    return np.asarray(cv2.resize(image[:, :, 1], size, interpolation=cv2.INTER_AREA), np.uint8)


def test_vehicles_behind_drops_are_detected() -> None:
    scene = demo_scene(0)
    width, height = scene.camera.width, scene.camera.height
    dry = Renderer(scene).image(FRAME)
    wet = with_drops(dry)
    assert (is_wet(plane_of(dry)), is_wet(plane_of(wet))) == (False, True)
    detector = load_detector(NetworkSettings()).for_video(width, height, [])
    boxes = detector.detect(detector.search(Picture(wet), FRAME))
    large = [item.box for item in true_boxes(scene, FRAME) if must_be_found(item, height)]
    sides = np.array([astuple(box) for box in large if box.width > width / 20])
    overlap = iou_matrix(sides, boxes[boxes.scores > 0.4].sides)
    assert (overlap.max(axis=1) > 0.5).all()
