"""The estimate of the true count from a sample of checked minutes."""

import json
from collections import Counter
from math import isclose
from pathlib import Path

import numpy as np
import pytest
from benchmarks.estimates import SITUATIONS, measure
from scipy import stats

from browser import browser
from vdet.pages.render import TEMPLATES
from vdet.traffic.estimate import CountError, Estimate, _gamma, _student, estimate
from vdet.traffic.sample import draw_minutes, strata_of

TRAFFIC = [0] * 20 + [4, 5, 6, 5] * 10 + [20, 30, 25, 40] * 5
CARS = {"car": [10] * 60}
MISSED = CountError(minute=0, counted=None, true="car")
FALSE = CountError(minute=0, counted="car", true=None)


def test_minutes_are_drawn_at_random_and_the_same_again() -> None:
    assert draw_minutes(TRAFFIC, seed=7) == draw_minutes(TRAFFIC, seed=7)
    assert draw_minutes(TRAFFIC, seed=7) != draw_minutes(TRAFFIC, seed=8)
    assert sorted(draw_minutes(TRAFFIC, seed=7)) == list(range(80))


def test_minutes_of_equal_traffic_are_drawn_equally_often() -> None:
    drawn = Counter(minute for seed in range(600) for minute in draw_minutes([5] * 12, seed)[:4])
    assert all(abs(drawn[minute] - 200) < 60 for minute in range(12))


def test_a_sample_has_minutes_of_little_and_of_much_traffic() -> None:
    strata = strata_of(TRAFFIC)
    assert set(strata) == {0, 1, 2, 3}
    for seed in range(20):
        drawn = [strata[minute] for minute in draw_minutes(TRAFFIC, seed)[:8]]
        assert set(drawn) == set(strata)


def test_errors_are_added_and_removed_where_all_minutes_are_checked() -> None:
    errors = [MISSED, MISSED, FALSE, CountError(minute=3, counted="car", true="bus")]
    estimates = estimate(CARS, errors, checked=range(60), drawn=[])
    assert estimates == [
        Estimate(group=None, counted=600, true=601, low=601, high=601, minutes_to_precision=0),
        Estimate(group="bus", counted=0, true=1, low=1, high=1, minutes_to_precision=0),
        Estimate(group="car", counted=600, true=600, low=600, high=600, minutes_to_precision=0),
    ]


def test_errors_in_the_sample_stand_for_those_in_other_minutes() -> None:
    errors = [CountError(minute, None, "car") for minute in range(12)]
    [whole, cars] = estimate(CARS, errors, checked=range(12), drawn=range(12))
    assert whole.true == pytest.approx(660)  # one of ten in each minute
    assert whole.low < 660 < whole.high
    assert (whole.low, whole.high) == (cars.low, cars.high)


def test_a_sample_without_errors_does_not_say_that_there_are_none() -> None:
    [whole, _] = estimate(CARS, [], checked=range(12), drawn=range(12))
    assert whole.true == 600
    # Up to 2.7 errors may go unseen in the sample; four times as many minutes are not checked.
    assert (whole.low, whole.high) == pytest.approx((600 - 4 * 2.74, 600 + 4 * 2.74), abs=2)


def test_minutes_that_were_not_drawn_say_nothing_about_others() -> None:
    errors = [CountError(50, None, "car")] * 9
    [whole, _] = estimate(CARS, errors, checked=[*range(12), 50], drawn=range(12))
    assert whole.true == 609
    assert estimate(CARS, errors, checked=range(40, 60), drawn=range(12)) == []


def test_more_minutes_bring_the_interval_to_two_percent() -> None:
    counted, order = {"car": [10] * 240}, list(range(240))
    errors = [CountError(minute, None, "car") for minute in range(0, 240, 2)]
    few = [error for error in errors if error.minute < 10]
    [whole, _] = estimate(counted, few, checked=order[:10], drawn=order)
    enough = 10 + whole.minutes_to_precision
    assert 20 < enough < 120
    many = [error for error in errors if error.minute < enough]
    [whole, _] = estimate(counted, many, checked=order[:enough], drawn=order)
    assert (whole.high - whole.low) / 2 == pytest.approx(0.02 * whole.true, rel=0.15)


@pytest.mark.parametrize("name", SITUATIONS)
def test_intervals_hold_the_truth(name: str) -> None:
    """93 % of many; of 60 samples, chance leaves at least 51 of them once in a thousand tests."""
    for group, results in measure(SITUATIONS[name], samples=60).items():
        assert sum(result.holds for result in results) >= 51, group


@pytest.mark.parametrize("shape", [1.0, 3.0, 20.0])
@pytest.mark.parametrize("p", [0.025, 0.975])
def test_quantiles_are_those_of_scipy(shape: float, p: float) -> None:
    """Within 3 % of the mean; the lowest ones are near zero."""
    exact = stats.gamma.ppf(p, shape, scale=1 / shape)
    assert _gamma(1.0, 1 / shape, stats.norm.ppf(p)) == pytest.approx(exact, abs=0.03)
    assert _student(round(2 + shape)) == pytest.approx(stats.t.ppf(0.975, round(2 + shape)), 0.01)


def test_the_page_shows_the_same_numbers(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    cases, expected = [], []
    for checked in (2, 3, 12, 60):
        counted = {
            "car": [int(number) for number in rng.poisson(8, 60)],
            "truck": [int(number) for number in rng.poisson(0.3, 60)],
        }
        traffic = [sum(numbers) for numbers in zip(*counted.values(), strict=True)]
        order = draw_minutes(traffic, seed=checked)
        kinds = [(None, "car"), ("car", None), ("car", "truck"), ("truck", "bus")]
        errors = [
            CountError(minute, *kinds[rng.integers(4)])
            for minute in order[:checked]
            if rng.random() < 0.7
        ]
        values = [{"minute": e.minute, "counted": e.counted, "true": e.true} for e in errors]
        strata = [int(stratum) for stratum in strata_of(traffic)]
        cases.append(
            {"counted": counted, "strata": strata, "errors": values, "order": order[:checked]}
        )
        expected.append(estimate(counted, errors, order[:checked], order))
    page = tmp_path / "page.html"
    script = (TEMPLATES / "estimate.js").read_text(encoding="utf-8")
    page.write_text(f"<body data-ready=yes><script>{script}</script>", encoding="utf-8")
    with browser(tmp_path) as window:
        window.open(page)
        shown = window.run(
            "return JSON.stringify(arguments[0].map(({ order, ...values }) =>"
            " estimateCounts({ ...values, checked: new Set(order), drawn: new Set(order) })))",
            cases,
        )
    for of_page, in_python in zip(json.loads(shown), expected, strict=True):
        assert [item["group"] for item in of_page] == [item.group for item in in_python]
        for item, exact in zip(of_page, in_python, strict=True):
            item["minutes_to_precision"] = item["minutesToPrecision"]
            for name in ("counted", "true", "low", "high", "minutes_to_precision"):
                assert isclose(item[name], getattr(exact, name), rel_tol=1e-9), (item, exact)
