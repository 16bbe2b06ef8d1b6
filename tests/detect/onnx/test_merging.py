"""One box for each vehicle, of the boxes of one search or of two."""

import numpy as np
import pytest

from vdet.detect.onnx.layouts import RawBoxes
from vdet.detect.onnx.merging import combine, suppress


def raw(*rows: tuple[list[float], float, list[float]]) -> RawBoxes:
    """Give boxes with their scores and the scores of two classes."""
    boxes = np.array([box for box, _, _ in rows], np.float32).reshape(-1, 4)
    likely = np.array([names for _, _, names in rows], np.float32).reshape(-1, 2)
    scores = np.array([score for _, score, _ in rows], np.float32)
    return RawBoxes(boxes, scores, likely.argmax(axis=1).astype(np.int32), likely)


def listed(found: RawBoxes) -> list[tuple[list[float], float, int]]:
    scores = np.round(found.scores.astype(float), 4).tolist()
    return list(zip(found.boxes.round(3).tolist(), scores, found.classes.tolist(), strict=True))


def test_a_box_goes_if_it_overlaps_a_better_one_too_much() -> None:
    found = raw(
        ([0, 0, 100, 50], 0.6, [1, 0]),
        ([0, 0, 100, 60], 0.9, [0, 1]),  # IoU 0.83 with the first
        ([60, 0, 160, 60], 0.5, [1, 0]),  # IoU 0.25 with the second
    )
    assert listed(suppress(found, 0.55)) == [([0, 0, 100, 60], 0.9, 1), ([60, 0, 160, 60], 0.5, 0)]


def test_boxes_of_two_searches_become_one_list() -> None:
    first = raw(
        ([0, 0, 100, 50], 0.8, [0.9, 0.1]),
        ([200, 0, 300, 50], 0.5, [0.2, 0.8]),
        ([206, 0, 306, 50], 0.4, [1, 0]),  # the second search has one box for these two
    )
    second = raw(
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
    found = raw(([0, 0, 100, 50], 0.8, [1, 0])).rows(np.arange(count))
    expected = [([0, 0, 100, 50], 0.4, 0)][:count]
    assert listed(combine(found, raw(), 0.55)) == listed(combine(raw(), found, 0.55)) == expected


def test_a_box_in_the_mirror_image() -> None:
    found = raw(([10, 20, 40, 50], 0.8, [1, 0]))
    assert listed(found.mirrored(100)) == [([60, 20, 90, 50], 0.8, 0)]
    assert listed(found.mirrored(100).mirrored(100)) == listed(found)
