"""A detector finds about the same in the planes of a decoder as in the same picture as BGR."""

from dataclasses import astuple, dataclass

import numpy as np

from codings import in_any_coding
from detect.svm.engine_comparison import fitted, log_odds, road
from vdet.boxes import Float32Array, Float64Array, Image, iou_matrix
from vdet.config.detector import FeatureSettings
from vdet.config.schema import SvmSettings
from vdet.detect.factory import load_detector
from vdet.detect.svm.search import FrameSearch
from vdet.media import Picture, Planes
from vdet.media.frame import Coding
from vdet.synthetic.random_scenes import demo_scene
from vdet.synthetic.truth import true_boxes

HORIZON = 0.57
"""Row of the horizon of the drawn road."""


def both_forms(image: Image, coding: Coding) -> tuple[Picture, Picture]:
    """Return an image as planes, and these as BGR."""
    picture = Picture(Planes.of_image(image, coding))
    return picture, Picture(picture.image)


@in_any_coding
def test_windows_have_about_the_same_probabilities(coding: Coding) -> None:
    search = FrameSearch(fitted(FeatureSettings()), SvmSettings(), 1280, 720, horizon=HORIZON)
    ours, expected = (
        log_odds(search.search(picture).probabilities) for picture in both_forms(road(), coding)
    )
    assert (expected > 0).any(), "nothing is found: decisions cannot differ"
    assert np.corrcoef(ours, expected)[0, 1] > 0.97
    assert np.mean((ours > 0) == (expected > 0)) > 0.95


@in_any_coding
def test_the_shipped_model_finds_the_same_vehicles(coding: Coding) -> None:
    ours, expected = (vehicles_in(picture) for picture in both_forms(road(), coding))
    for found in (ours, expected):
        assert np.diag(iou_matrix(found.boxes, TRUE_BOXES)).min() > 0.35
        assert found.scores.min() > 0.8


@dataclass(frozen=True, slots=True)
class Vehicles:
    """The detection of each vehicle of the drawn road, in the order of `TRUE_BOXES`.

    The model was trained on photographs and finds more than vehicles in a drawing. What else it
    finds changes when each value of the BGR image changes by one level at random.
    """

    boxes: Float64Array  # x, y, width, height
    scores: Float32Array


SCENE = demo_scene(7, width=1280, height=720)
TRUE_BOXES = np.array([astuple(true.box) for true in true_boxes(SCENE, 200)], np.float64)


def vehicles_in(picture: Picture) -> Vehicles:
    detector = load_detector(SvmSettings()).for_video(1280, 720, [road()])
    found = detector.detect(detector.search(picture, None))
    boxes = found.sides
    nearest = iou_matrix(boxes, TRUE_BOXES).argmax(axis=0)
    return Vehicles(boxes[nearest], found.scores[nearest])
