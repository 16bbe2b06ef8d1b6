import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn import metrics

from vdet.learn.patch_eval.measures import BINS, MEASURES, bins_of, measure

# ties are wanted: probabilities come in twentieths
PATCHES = st.lists(
    st.tuples(st.booleans(), st.integers(0, 20), st.integers(0, 3)), min_size=2, max_size=40
).filter(
    lambda rows: (
        {vehicle for vehicle, _, weight in rows if weight} == {False, True}
        and any(twentieths >= 10 and weight for _, twentieths, weight in rows)
    )
)


def ranked(rows: list[tuple[bool, int, int]]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    ordered = sorted(rows, key=lambda row: -row[1])
    vehicle = np.array([row[0] for row in ordered])
    probabilities = np.array([row[1] / 20 for row in ordered])
    return vehicle, probabilities, np.array([row[2] for row in ordered])


@settings(deadline=None, max_examples=40)
@given(PATCHES)
def test_weighted_measures_are_those_of_scikit_learn(rows: list[tuple[bool, int, int]]) -> None:
    vehicle, probabilities, counts = ranked(rows)
    said, weights = probabilities >= 0.5, counts.astype(float)
    scores = measure(vehicle, probabilities, weights[np.newaxis])
    expected = {
        "accuracy": metrics.accuracy_score(vehicle, said, sample_weight=weights),
        "precision": metrics.precision_score(vehicle, said, sample_weight=weights),
        "recall": metrics.recall_score(vehicle, said, sample_weight=weights),
        "f1": metrics.f1_score(vehicle, said, sample_weight=weights),
        "roc_auc": metrics.roc_auc_score(vehicle, probabilities, sample_weight=weights),
        "average_precision": metrics.average_precision_score(
            vehicle, probabilities, sample_weight=weights
        ),
        "log_loss": metrics.log_loss(vehicle, probabilities, sample_weight=weights),
    }
    for name, value in expected.items():
        assert scores[name][0] == pytest.approx(value, abs=1e-9), name


@settings(deadline=None, max_examples=40)
@given(PATCHES)
def test_a_count_weighs_like_so_many_copies(rows: list[tuple[bool, int, int]]) -> None:
    vehicle, probabilities, counts = ranked(rows)
    weighted = measure(vehicle, probabilities, counts[np.newaxis].astype(float))
    vehicle, probabilities = np.repeat(vehicle, counts), np.repeat(probabilities, counts)
    copied = measure(vehicle, probabilities, np.ones((1, len(vehicle))))
    for name in MEASURES:
        assert weighted[name][0] == pytest.approx(copied[name][0], abs=1e-9), name


def test_calibration_error_is_the_mean_gap_of_the_bins() -> None:
    # bin 0.9–1: probability 0.9, of two patches one is a vehicle: gap 0.4;
    # bin 0.1–0.2: probability 0.1, none of two: gap 0.1; mean over the patches 0.25
    vehicle = np.array([True, False, False, False])
    probabilities = np.array([0.9, 0.9, 0.1, 0.1])
    scores = measure(vehicle, probabilities, np.ones((1, 4)))
    assert scores["calibration_error"][0] == pytest.approx(0.25)


def test_many_weightings_at_once_are_each_measured_alone() -> None:
    random = np.random.default_rng(3)
    vehicle = random.random(50) < 0.5
    probabilities = np.sort(random.random(50))[::-1]
    weights = random.integers(0, 3, (4, 50)).astype(float)
    together = measure(vehicle, probabilities, weights)
    for number in range(4):
        alone = measure(vehicle, probabilities, weights[number : number + 1])
        assert {name: together[name][number] for name in MEASURES} == pytest.approx(
            {name: alone[name][0] for name in MEASURES}
        )


@pytest.mark.parametrize("vehicles", [True, False])
def test_of_one_class_only_accuracy_and_recall_have_a_meaning(vehicles: bool) -> None:
    probabilities = np.array([0.9, 0.6, 0.2])
    scores = measure(np.full(3, vehicles), probabilities, np.ones((1, 3)))
    known = {name for name in MEASURES if not np.isnan(scores[name][0])}
    assert known == ({"accuracy", "recall"} if vehicles else {"accuracy"})
    assert scores["accuracy"][0] == pytest.approx(2 / 3 if vehicles else 1 / 3)


def test_certainty_that_is_wrong_costs_much_but_not_infinitely() -> None:
    scores = measure(np.array([False, True]), np.array([1.0, 0.0]), np.ones((1, 2)))
    assert 30 < scores["log_loss"][0] < 40


def test_probability_one_is_in_the_last_bin() -> None:
    assert bins_of(np.array([0.0, 0.1, 0.95, 1.0])).tolist() == [0, 1, BINS - 1, BINS - 1]
