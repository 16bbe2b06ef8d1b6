import math

import numpy as np
import pytest

from vdet.boxes import BoolArray, Float64Array
from vdet.learn.svm.metrics import Confusion
from vdet.learn.svm.patch_eval.metrics import (
    METRICS,
    intervals,
    metrics_of,
    patch_scores,
    ranking_curves,
    reliability,
)


def test_the_metrics_of_four_patches() -> None:
    # One of two vehicles and one of two others are right. Of the four pairs of a vehicle and
    # another, three are in order. Precision is 1 at recall 1/2 and 2/3 at recall 1. Each patch has
    # a bin of its own, with gaps of 0.1, 0.6, 0.6 and 0.1.
    vehicle = np.array([True, True, False, False])
    assert metrics_of(vehicle, np.array([0.9, 0.4, 0.6, 0.1])) == pytest.approx(
        {
            "accuracy": 1 / 2,
            "precision": 1 / 2,
            "recall": 1 / 2,
            "f1": 1 / 2,
            "roc_auc": 3 / 4,
            "average_precision": (1 + 2 / 3) / 2,
            "log_loss": -math.log(0.9 * 0.4) / 2,
            "calibration_error": 0.35,
        }
    )


def test_patches_of_equal_probability_are_half_in_order() -> None:
    found = metrics_of(np.array([True, False, False]), np.array([0.7, 0.7, 0.2]))
    assert found["roc_auc"] == pytest.approx((0.5 + 1) / 2)


def test_calibration_error_is_the_mean_gap_of_the_bins() -> None:
    # bin 0.9–1: probability 0.9, of two patches one is a vehicle: gap 0.4;
    # bin 0.1–0.2: probability 0.1, none of two: gap 0.1; mean over the patches 0.25
    vehicle = np.array([True, False, False, False])
    found = metrics_of(vehicle, np.array([0.9, 0.9, 0.1, 0.1]))
    assert found["calibration_error"] == pytest.approx(0.25)


@pytest.mark.parametrize("vehicles", [True, False])
def test_of_one_class_only_accuracy_and_recall_have_a_meaning(vehicles: bool) -> None:
    found = metrics_of(np.full(3, vehicles), np.array([0.9, 0.6, 0.2]))
    assert set(found) == ({"accuracy", "recall"} if vehicles else {"accuracy"})
    assert found["accuracy"] == pytest.approx(2 / 3 if vehicles else 1 / 3)


def test_without_a_patch_classified_as_vehicle_there_is_no_precision() -> None:
    scores = patch_scores(np.array([True, False]), np.array([0.4, 0.2]))
    assert (scores.precision, scores.recall, scores.f1, scores.roc_auc) == (None, 0, 0, 1)
    assert "precision" not in scores.intervals


def test_certainty_that_is_wrong_costs_much_but_not_infinitely() -> None:
    found = metrics_of(np.array([False, True]), np.array([1.0, 0.0]))
    assert 30 < found["log_loss"] < 40


def test_scores_do_not_depend_on_the_order_of_the_patches() -> None:
    vehicle, probabilities = np.array([True, False, True, False]), np.array([0.9, 0.2, 0.4, 0.6])
    forward = patch_scores(vehicle, probabilities)
    backward = patch_scores(vehicle[::-1], probabilities[::-1])
    assert forward.confusion == backward.confusion == Confusion(1, 1, 1, 1)
    # pairs of a vehicle and another thing in the right order: 3 of 4
    assert forward.roc_auc == backward.roc_auc == 0.75


def test_reliability_is_the_share_of_vehicles_in_each_bin() -> None:
    low, high = reliability(
        np.array([True, False, False, True]), np.array([0.11, 0.13, 0.15, 0.95])
    )
    assert (low.patches, high.patches) == (3, 1)
    assert low.mean_probability == pytest.approx(0.13)
    assert low.vehicle_share == pytest.approx(1 / 3)
    assert high.vehicle_share == 1


def test_the_bins_include_their_lower_end_and_the_last_one_includes_1() -> None:
    probabilities = np.array([0.0, 0.1, 0.95, 1.0])
    found = reliability(np.full(4, True), probabilities)
    assert [each.patches for each in found] == [1, 1, 2]


def test_curves_need_both_classes() -> None:
    assert ranking_curves(np.array([True, True]), np.array([0.9, 0.1])) is None
    curves = ranking_curves(np.array([True, False]), np.array([0.9, 0.1]))
    assert curves is not None
    assert curves.true_positive_rates[-1] == curves.false_positive_rates[-1] == 1
    assert max(curves.precisions) == max(curves.recalls) == 1


def patches(count: int) -> tuple[BoolArray, Float64Array]:
    """Return as many vehicles as others; 9 of 10 are classified correctly."""
    vehicle = np.arange(count) < count // 2
    right = np.arange(count) % 10 != 0
    return vehicle, np.where(vehicle == right, 0.8, 0.2)


@pytest.mark.parametrize("classes", [1, 2])
def test_the_interval_of_a_share_is_the_binomial_one(
    classes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    # p = 0.9, n = 1000: 1.96·√(p(1 - p)/n) = 0.0186 on either side
    monkeypatch.setattr("vdet.learn.svm.patch_eval.metrics.RESAMPLES", 300)
    vehicle, probabilities = patches(1000 * 2 // classes)
    rows = slice(0, 1000)
    interval = intervals(vehicle[rows], probabilities[rows])["accuracy"]
    assert interval.low == pytest.approx(0.9 - 0.0186, abs=0.004)
    assert interval.high == pytest.approx(0.9 + 0.0186, abs=0.004)


def test_two_runs_agree() -> None:
    assert intervals(*patches(60)) == intervals(*patches(60))


def test_every_metric_has_an_interval_around_its_value() -> None:
    data = patches(200)
    found, values = intervals(*data), metrics_of(*data)
    assert set(found) == set(METRICS)
    assert all(found[name].low <= values[name] <= found[name].high for name in METRICS)


def test_a_metric_without_meaning_has_no_interval() -> None:
    assert set(intervals(np.full(5, False), np.full(5, 0.2))) == {"accuracy"}


def test_the_interval_of_a_single_patch_is_its_value() -> None:
    scores = patch_scores(np.array([False]), np.array([0.1]))
    assert scores.confusion == Confusion(0, 0, 0, 1)
    interval = scores.intervals["accuracy"]
    assert interval.low == interval.high == scores.accuracy == 1
