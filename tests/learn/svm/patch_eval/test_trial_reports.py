from pathlib import Path

import numpy as np

from vdet.learn.svm.dataset import PatchFile
from vdet.learn.svm.extraction import LabelledVectors, Rows
from vdet.learn.svm.patch_eval.evaluate import MOST_MISTAKES, TrialReport, report_trial
from vdet.learn.svm.patch_eval.trials import Trial


def report(vehicle: list[bool], probabilities: list[float]) -> TrialReport:
    """Return the report on patches 0, 1, 2 … in one group per class."""
    flags = np.array(vehicle)
    groups = np.where(flags, "vehicles/a", "non-vehicles/a")
    data = LabelledVectors(Rows.of_patches(np.zeros((len(flags), 1), np.float32), flags), groups)
    files = [
        PatchFile(Path("set"), f"{number}.png", str(group), bool(flag))
        for number, (group, flag) in enumerate(zip(groups, flags, strict=True))
    ]
    trial = Trial("tail", np.arange(len(flags)), np.array(probabilities), 1)
    return report_trial(trial, "a meaning", data, files)


def test_a_group_has_accuracy_and_for_vehicles_recall() -> None:
    others, vehicles = report([True, False, True, False], [0.9, 0.2, 0.4, 0.6]).groups
    assert (others.group, others.scores.accuracy, others.scores.recall) == (
        *("non-vehicles/a", 0.5),
        None,
    )
    assert (vehicles.group, vehicles.scores.accuracy, vehicles.scores.recall) == (
        *("vehicles/a", 0.5),
        0.5,
    )
    assert set(others.scores.intervals) == {"accuracy"}
    assert vehicles.scores.precision is vehicles.scores.roc_auc is None


def test_the_worst_mistakes_come_first() -> None:
    mistakes = report([True, False, True, False, True], [0.3, 0.95, 0.9, 0.6, 0.01]).mistakes
    assert [(m.file.name, m.probability) for m in mistakes] == [
        *(("4.png", 0.01), ("1.png", 0.95)),
        *(("0.png", 0.3), ("3.png", 0.6)),
    ]


def test_many_mistakes_of_one_kind_do_not_hide_the_other() -> None:
    many = report([False] * 40 + [True], [0.99] * 40 + [0.4]).mistakes
    assert len(many) == MOST_MISTAKES + 1
    assert many[-1].file.vehicle


def test_without_wrong_patches_there_are_no_mistakes() -> None:
    assert report([True, False], [0.9, 0.1]).mistakes == ()
