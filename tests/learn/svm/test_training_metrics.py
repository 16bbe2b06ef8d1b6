"""The metrics of `vdet train` as text and as JSON."""

from dataclasses import replace

import numpy as np
import pytest

from vdet.learn.svm.metrics import Classification, Rate, TrainingMetrics

TEST = Classification(
    20, Rate(0.9, 0.7, 0.97), [[11, 2], [1, 6]], {"vehicles/far": Rate(0.84615, 0.5, 0.9)}
)
GROUPS = {"vehicles/far": 60, "boxes/mined": 7}
METRICS = TrainingMetrics(
    60, 40, 9, GROUPS, 4800, "tail", 80, 90, train_accuracy=1.0, test=TEST, box_error=0.0431
)


def lines(metrics: TrainingMetrics) -> list[str]:
    return list(metrics.lines())


def test_patches_are_compared_by_class_and_by_group() -> None:
    vehicle = np.array([True, True, True, False, False])
    predicted = np.array([True, True, False, True, False])
    found = Classification.of(vehicle, predicted, np.array(["a", "a", "b", "c", "c"]))
    assert (found.patches, found.accuracy.value) == (5, 0.6)
    assert found.confusion == [[2, 1], [1, 1]]
    assert {name: rate.value for name, rate in found.groups.items()} == {"a": 1, "b": 0, "c": 0.5}


def test_the_interval_is_that_of_wilson() -> None:
    rate = Rate.of(np.arange(1000) % 10 != 0)  # p = 0.9, n = 1000
    assert (rate.value, rate.low, rate.high) == pytest.approx((0.9, 0.8799, 0.9171), abs=1e-4)
    assert str(Rate.of(np.zeros(0, bool))) == "–"


def test_the_text_has_the_split_with_accuracies_confusion_and_groups() -> None:
    text = lines(METRICS)
    assert text[0] == (
        "patches: 60 vehicles, 40 non-vehicles, 9 with the box of their vehicle; 4800 features each"
    )
    accuracy = (
        "train accuracy 1.0000 (80 patches + 90 augmented), "
        "test accuracy 0.9000 [0.700, 0.970] (20 patches)"
    )
    assert text.count(accuracy) == 1
    assert any("leak-free" in line for line in text)
    rows = [line.split() for line in text]
    for words in ("is vehicle 11 2", "is non-vehicle 1 6", "vehicles/far 0.8461 [0.500, 0.900]"):
        assert rows.count(words.split()) == 1
    assert rows.count(["boxes/mined", "7", "patches"]) == 1
    assert "sides of vehicles' boxes: mean error 0.043 of a patch's side" in text


def test_the_text_says_what_a_model_of_patches_alone_lacks() -> None:
    words = "no patch came from vdet mine: in video, such a model finds far fewer vehicles"
    bare = replace(METRICS, boxed=0, train_augmented=0, box_error=None)
    text = "\n".join(lines(bare))
    assert words in text
    assert "augmented" not in text
    assert "sides of" not in text
    assert words not in "\n".join(lines(METRICS))
