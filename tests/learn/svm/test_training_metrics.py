"""The metrics of `vdet train`, as text."""

from dataclasses import replace

import numpy as np

from vdet.learn.svm.training import Classification, TrainingMetrics

TEST = Classification.of(
    np.array([True, True, True, False, False]),
    np.array([True, True, False, True, False]),
    np.array(["a", "a", "b", "c", "c"]),
)
METRICS = TrainingMetrics({"a": 60, "boxes/mined": 7}, 170, 1.0, TEST, box_error=0.0431)


def test_patches_are_compared_by_class_and_by_group() -> None:
    assert (
        Classification(5, 0.6, 2 / 3, 2 / 3, [[2, 1], [1, 1]], {"a": 1.0, "b": 0.0, "c": 0.5})
        == TEST
    )
    none = np.zeros(2, bool)
    without = Classification.of(none, none, np.array(["a", "a"]))
    assert (without.accuracy, without.precision, without.recall) == (1, None, None)


def test_the_text_has_the_accuracies_the_confusion_and_the_groups() -> None:
    rows = [line.split() for line in METRICS.lines()]
    for words in (
        *("a 60 patches", "boxes/mined 7 patches", "train accuracy 1.0000 (170 samples)"),
        *("patches tested: 5", "accuracy 0.6000", "precision 0.6667", "recall 0.6667"),
        *("is vehicle 2 1", "is non-vehicle 1 1", "c 0.5000"),
        "sides of vehicles' boxes: mean error 0.043 of a patch's side",
    ):
        assert rows.count(words.split()) == 1


def test_the_text_says_what_a_model_of_patches_alone_lacks() -> None:
    words = "no patches from vdet mine: in video, such a model finds far fewer vehicles"
    assert words in replace(METRICS, box_error=None).lines()
