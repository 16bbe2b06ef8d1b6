import numpy as np
import pytest

from vdet.learn.patch_eval.bootstrap import intervals
from vdet.learn.patch_eval.measures import MEASURES


def patches(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return as many vehicles as others; 9 of 10 are told rightly."""
    vehicle = np.arange(count) < count // 2
    right = np.arange(count) % 10 != 0
    return vehicle[order(vehicle, right)], np.sort(np.where(vehicle == right, 0.8, 0.2))[::-1]


def order(vehicle: np.ndarray, right: np.ndarray) -> np.ndarray:
    return np.argsort(-np.where(vehicle == right, 0.8, 0.2), kind="stable")


def test_the_interval_of_a_share_is_the_binomial_one() -> None:
    # p = 0.9, n = 1000: 1.96·√(p(1 - p)/n) = 0.0186 on either side
    interval = intervals(*patches(1000))["accuracy"]
    assert interval.low == pytest.approx(0.9 - 0.0186, abs=0.004)
    assert interval.high == pytest.approx(0.9 + 0.0186, abs=0.004)


def test_two_runs_agree() -> None:
    assert intervals(*patches(60)) == intervals(*patches(60))


def test_every_measure_has_an_interval_in_order() -> None:
    found = intervals(*patches(60))
    assert set(found) == set(MEASURES)
    assert all(interval.low <= interval.high for interval in found.values())


def test_a_measure_without_meaning_has_none() -> None:
    assert set(intervals(np.full(5, False), np.full(5, 0.2))) == {"accuracy"}
