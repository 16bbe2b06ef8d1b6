from pathlib import Path

import numpy as np
import pytest

from vdet.learn.dataset import PatchFile
from vdet.learn.extraction import LabelledVectors
from vdet.learn.patch_eval.results import TrialReport
from vdet.learn.patch_eval.summary import WORST, patch_scores, reliability, sum_up
from vdet.learn.patch_eval.trials import Trial
from vdet.learn.report import Confusion


def report(vehicle: list[bool], probabilities: list[float]) -> TrialReport:
    """Sum up a test of patches 0, 1, 2 … in one group a class."""
    flags = np.array(vehicle)
    groups = np.where(flags, "vehicles/a", "non-vehicles/a")
    data = LabelledVectors(np.zeros((len(flags), 1), np.float32), flags, groups, "", 0)
    files = [
        PatchFile(Path("set"), f"{number}.png", str(group), bool(flag))
        for number, (group, flag) in enumerate(zip(groups, flags, strict=True))
    ]
    trial = Trial("tail", np.arange(len(flags)), np.array(probabilities), 1)
    return sum_up(trial, "a meaning", data=data, files=files)


def test_scores_do_not_depend_on_the_order_of_the_patches() -> None:
    vehicle, probabilities = [True, False, True, False], [0.9, 0.2, 0.4, 0.6]
    forward = report(vehicle, probabilities).scores
    backward = report(vehicle[::-1], probabilities[::-1]).scores
    assert forward.confusion == backward.confusion == Confusion(1, 1, 1, 1)
    # pairs of a vehicle and another thing in the right order: 3 of 4
    assert forward.roc_auc == backward.roc_auc == 0.75


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


def test_mistakes_of_one_kind_do_not_crowd_out_the_other() -> None:
    many = report([False] * 40 + [True], [0.99] * 40 + [0.4]).mistakes
    assert len(many) == WORST + 1
    assert many[-1].file.vehicle


def test_nothing_wrong_is_no_mistake() -> None:
    assert report([True, False], [0.9, 0.1]).mistakes == ()


def test_reliability_says_how_many_of_a_bin_are_vehicles() -> None:
    low, high = reliability(
        np.array([True, False, False, True]), np.array([0.11, 0.13, 0.15, 0.95])
    )
    assert (low.patches, high.patches) == (3, 1)
    assert low.mean_probability == pytest.approx(0.13)
    assert low.vehicle_share == pytest.approx(1 / 3)
    assert high.vehicle_share == 1


def test_a_test_of_one_class_has_no_curves() -> None:
    assert report([True, True], [0.9, 0.1]).curves is None
    assert patch_scores(np.array([False]), np.array([0.1])).confusion == Confusion(0, 0, 0, 1)
