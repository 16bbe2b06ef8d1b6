import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from vdet.errors import OutputError
from vdet.learn.svm.metrics import BoxError, Confusion, GroupAccuracy, SplitMetrics, TrainingMetrics


def split_report(name: str) -> SplitMetrics:
    return SplitMetrics(
        split=name,
        train_patches=80,
        train_augmented=90,
        test_patches=20,
        train_accuracy=1.0,
        test_accuracy=0.9,
        confusion=Confusion(11, 1, 2, 6),
        groups=(
            GroupAccuracy("vehicles/far", 13, 0.84615),
            GroupAccuracy("non-vehicles", 7, 0.857),
        ),
        boxes=BoxError(15, 0.04321),
        fit_seconds=1.25,
    )


def report(broken: int = 0) -> TrainingMetrics:
    splits = (split_report("random"), split_report("tail"))
    groups = {"vehicles/far": 60, "non-vehicles": 40, "boxes/mined": 7}
    return TrainingMetrics(60, 40, 9, broken, groups, 4800, 2.5, 0.7214, splits)


def test_a_confusion_counts_patches_by_truth_and_prediction() -> None:
    truth = np.array([True] * 5 + [False] * 6)
    predicted = np.array([True, True, False, False, False, True, *[False] * 5])
    assert Confusion.of(truth, predicted) == Confusion(
        true_positives=2, false_positives=1, false_negatives=3, true_negatives=5
    )


def test_the_report_says_how_many_patches_of_each_class_there_were() -> None:
    first = next(report().lines())
    assert first == "patches: 60 vehicles, 40 non-vehicles; 4800 features each, described in 2.5 s"


def test_the_report_counts_broken_patches() -> None:
    assert "40 non-vehicles (3 broken ones skipped);" in next(report(3).lines())


def test_the_report_has_both_splits_with_accuracies_confusion_and_groups() -> None:
    text = "\n".join(report().lines())
    assert text.index("random split") < text.index("tail split (leak-free")
    assert (
        text.count(
            "train accuracy 1.0000 (80 patches + 90 augmented), test accuracy 0.9000 (20 patches)"
        )
        == 2
    )
    rows = [line.split() for line in text.splitlines()]
    assert rows.count(["is", "vehicle", "11", "2"]) == 2
    assert rows.count(["is", "non-vehicle", "1", "6"]) == 2
    assert rows.count(["vehicles/far", "13", "patches", "accuracy", "0.8461"]) == 2
    assert "one prediction: 0.72 ms" in text


def test_the_report_counts_the_patches_of_each_group_and_those_with_boxes() -> None:
    text = list(report().lines())
    assert "patches with the box of their vehicle: 9" in text
    rows = [line.split() for line in text]
    assert rows.count(["boxes/mined", "7", "patches"]) == 1
    assert rows.count(["vehicles/far", "60", "patches"]) == 1


def test_without_boxes_and_augmentation_the_report_does_not_mention_them() -> None:
    bare = replace(split_report("tail"), train_augmented=0, boxes=None)
    text = "\n".join(replace(report(), boxed=0, splits=(bare,)).lines())
    assert "box" not in text.replace("boxes/mined", "")
    assert "augmented" not in text


def test_the_report_says_how_far_boxes_are_off() -> None:
    text = "\n".join(report().lines())
    assert "sides of vehicles' boxes: mean error 0.043 of a patch's side (15 patches)" in text


def test_the_report_is_written_as_json(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    report().write(path)
    written = json.loads(path.read_text())
    assert written == json.loads(json.dumps(asdict(report())))
    assert written["splits"][1]["confusion"]["false_negatives"] == 2


def test_the_report_is_not_written_into_a_missing_folder(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot be written"):
        report().write(tmp_path / "no" / "report.json")


def test_a_model_of_patches_alone_is_told_what_it_lacks() -> None:
    words = "no patch came from vdet mine: in video, such a model finds far fewer vehicles"
    assert words in "\n".join(replace(report(), boxed=0).lines())
    assert words not in "\n".join(report().lines())
