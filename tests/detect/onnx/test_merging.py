"""One box for each vehicle, of the boxes of one search or of two."""

from dataclasses import dataclass
from typing import cast

import numpy as np
import pytest

from vdet.boxes import Boxes, Float32Array
from vdet.config.schema import NetworkSettings
from vdet.detect.onnx.detector import (
    NetworkDetector,
    class_numbers,
    combine,
    combined_classes,
    suppress,
)
from vdet.detect.onnx.network import Recognized
from vdet.media import Picture


def boxes_of(*rows: tuple[list[float], float, list[float]]) -> Boxes:
    """Give boxes with their scores and the scores of two classes."""
    class_scores = np.reshape([scores for _, _, scores in rows], (-1, 2))
    return Boxes(
        [sides for sides, _, _ in rows],
        [score for _, score, _ in rows],
        classes=class_scores.argmax(axis=1),
        names=("car", "truck"),
        data={"class_scores": class_scores},
    )


def listed(boxes: Boxes) -> list[tuple[list[float], float, int]]:
    assert boxes.classes is not None
    scores = boxes.scores.round(4).tolist()
    return list(zip(boxes.sides.round(3).tolist(), scores, boxes.classes.tolist(), strict=True))


def test_a_box_goes_if_it_overlaps_a_better_one_too_much() -> None:
    found = boxes_of(
        ([0, 0, 100, 50], 0.6, [1, 0]),
        ([0, 0, 100, 60], 0.9, [0, 1]),  # IoU 0.83 with the first
        ([60, 0, 160, 60], 0.5, [1, 0]),  # IoU 0.25 with the second
    )
    assert listed(suppress(found, 0.55)) == [([0, 0, 100, 60], 0.9, 1), ([60, 0, 160, 60], 0.5, 0)]


def test_boxes_of_two_searches_become_one_list() -> None:
    first = boxes_of(
        ([0, 0, 100, 50], 0.8, [0.9, 0.1]),
        ([200, 0, 300, 50], 0.5, [0.2, 0.8]),
        ([206, 0, 306, 50], 0.4, [1, 0]),  # the second search has one box for these two
    )
    second = boxes_of(
        ([200, 0, 300, 50], 0.9, [0.8, 0.2]),
        ([500, 0, 540, 20], 0.6, [0, 1]),
        ([0, 0, 100, 40], 0.2, [0.4, 0.6]),
    )
    # Odds: 1.65 √(1 · 9) = 4.95, and 1.65 √(4 · 0.25) = 1.65; of one search, half the score.
    assert listed(combine(first, second, 0.55)) == [
        ([200, 0, 300, 50], pytest.approx(4.95 / 5.95, abs=1e-4), 0),
        ([0, 0, 100, 48], pytest.approx(1.65 / 2.65, abs=1e-4), 0),
        ([500, 0, 540, 20], 0.3, 1),
    ]


@pytest.mark.parametrize("count", [0, 1])
def test_a_search_may_find_nothing(count: int) -> None:
    found = boxes_of(([0, 0, 100, 50], 0.8, [1, 0]))[:count]
    expected = [([0, 0, 100, 50], 0.4, 0)][:count]
    assert listed(combine(found, boxes_of(), 0.55)) == expected
    assert listed(combine(boxes_of(), found, 0.55)) == expected


@dataclass(frozen=True)
class FixedSearch:
    """A network of two classes that finds a vehicle in the middle of all pictures."""

    class_scores: list[float]
    is_named: bool = True

    def find(self, *_: object) -> Float32Array:
        best = int(np.argmax(self.class_scores))
        return np.array([[40, 20, 60, 40, 0.8, best, *self.class_scores]], np.float32)


def found_in_image(first: list[float], second: list[float], *classes: str) -> dict[str, float]:
    """Return classes and scores of a vehicle; both searches give scores of car and truck for it."""
    settings = NetworkSettings(classes=classes)
    numbers = np.array([*class_numbers(("car", "truck"), combined_classes(settings)), -1], np.int32)
    network, larger = (cast("Recognized", FixedSearch(scores)) for scores in (first, second))
    detector = NetworkDetector(network, larger, numbers, settings)
    detections = detector.detect(detector.search(Picture(np.zeros((60, 100, 3), np.uint8)), None))
    names = [str(name) for name in detections.class_names]
    return dict(zip(names, detections.scores.round(4).tolist(), strict=True))


def test_a_vehicle_that_two_searches_name_differently_is_found_by_both() -> None:
    """With fewer classes, an image has the same vehicles of these classes, with the same scores."""
    every = found_in_image([0.9, 0.1], [0.3, 0.7], "car", "truck")
    assert every == {"car": pytest.approx(6.6 / 7.6, abs=1e-4)}  # odds: 1.65 √(4 · 4)
    assert found_in_image([0.9, 0.1], [0.3, 0.7], "car") == every
    assert found_in_image([0.9, 0.1], [0.3, 0.7], "truck") == {}
