"""The estimate of the true count from a sample of checked minutes."""

import json
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from math import isclose
from pathlib import Path

import numpy as np
import pytest
from benchmarks.estimates import BURSTS, SITUATIONS, measure
from numpy.typing import NDArray

from browser import browser
from vdet.pages.render import TEMPLATES
from vdet.review.estimate import draw_spans, estimate, strata_of
from vdet.traffic.counts import ALL, Estimate, VehicleGroup


def label(group: VehicleGroup) -> str:
    """Return the name of a group on the page."""
    return group.class_name or "all"


Numbers = dict[VehicleGroup, NDArray[np.int64]]
TRAFFIC = [0] * 20 + [4, 5, 6, 5] * 10 + [20, 30, 25, 40] * 5
CAR, BUS, IN = (
    VehicleGroup(class_name="car"),
    VehicleGroup(class_name="bus"),
    VehicleGroup("gate", "in"),
)
Groups = tuple[VehicleGroup, ...]
ONE = (ALL, IN, CAR)


@dataclass(frozen=True)
class CountError:
    """A vehicle in a span, by the groups in which it was counted, and is right."""

    span: int
    counted: Groups
    true: Groups


MISSED = CountError(span=0, counted=(), true=ONE)
FALSE = CountError(span=0, counted=ONE, true=())


def numbers(counted: Mapping[VehicleGroup, list[int]], *errors: CountError) -> Numbers:
    """Return what was counted in each span, and of errors what was missed and what is wrong."""
    of_groups = dict.fromkeys((*counted, *(group for error in errors for group in error.true)))
    [length] = {len(each) for each in counted.values()}
    table = {group: np.zeros((3, length), np.int64) for group in of_groups}
    for group, each in counted.items():
        table[group][0] = each
    for error in errors:
        for group in {*error.true} - {*error.counted}:
            table[group][1, error.span] += 1
        for group in {*error.counted} - {*error.true}:
            table[group][2, error.span] += 1
    return table


def cars(*errors: CountError) -> Numbers:
    """Return 60 spans with ten cars each, and errors."""
    return numbers(dict.fromkeys(ONE, [10] * 60), *errors)


def test_minutes_are_drawn_at_random_and_the_same_again() -> None:
    assert draw_spans(TRAFFIC, seed=7) == draw_spans(TRAFFIC, seed=7)
    assert draw_spans(TRAFFIC, seed=7) != draw_spans(TRAFFIC, seed=8)
    assert sorted(draw_spans(TRAFFIC, seed=7)) == list(range(80))


def test_minutes_of_equal_traffic_are_drawn_equally_often() -> None:
    drawn = Counter(minute for seed in range(600) for minute in draw_spans([5] * 12, seed)[:4])
    assert all(abs(drawn[minute] - 200) < 60 for minute in range(12))


def test_a_sample_has_minutes_of_little_and_of_much_traffic() -> None:
    strata = strata_of(TRAFFIC)
    assert set(strata) == {0, 1, 2, 3}
    for seed in range(20):
        drawn = [strata[minute] for minute in draw_spans(TRAFFIC, seed)[:8]]
        assert set(drawn) == set(strata)


def test_errors_are_added_and_removed_where_all_minutes_are_checked() -> None:
    errors = [MISSED, MISSED, FALSE, CountError(span=3, counted=ONE, true=(ALL, IN, BUS))]
    assert estimate(cars(*errors), checked=range(60), drawn=[]) == [
        Estimate(group, counted, true, true, true, true, minutes_to_precision=0)
        for group, counted, true in ((ALL, 600, 601), (IN, 600, 601), (CAR, 600, 600), (BUS, 0, 1))
    ]


def test_errors_in_the_sample_stand_for_those_in_other_minutes() -> None:
    errors = [CountError(span, (), ONE) for span in range(12)]
    [whole, _, of_cars] = estimate(cars(*errors), checked=range(12), drawn=range(12))
    assert whole.true == pytest.approx(660)  # one of ten in each minute
    assert whole.low < 660 < whole.high
    assert (whole.low, whole.high) == (of_cars.low, of_cars.high)


def test_a_sample_without_errors_does_not_say_that_there_are_none() -> None:
    [whole, _, _] = estimate(cars(), checked=range(12), drawn=range(12))
    assert whole.true == 600
    # Up to 2.7 errors may go unseen in the sample; four times as many spans are not checked. Missed
    # vehicles may come together.
    assert (whole.low, whole.high) == pytest.approx((600 - 4 * 2.74, 600 + 4 * 4.27), abs=2)


def test_minutes_that_were_not_drawn_say_nothing_about_others() -> None:
    errors = [CountError(50, (), ONE)] * 9
    [whole, _, _] = estimate(cars(*errors), checked=[*range(12), 50], drawn=range(12))
    assert whole.true == 609
    [whole, _, _] = estimate(cars(*errors), checked=range(12), drawn=range(12))
    assert (whole.corrected, whole.true) == (609, 600), "known, but of a span that is not checked"
    assert estimate(cars(*errors), checked=range(40, 60), drawn=range(12)) == []


def test_more_minutes_bring_the_interval_to_two_percent() -> None:
    counted, order = {ALL: [10] * 240}, list(range(240))
    errors = [CountError(span, (), (ALL,)) for span in range(0, 240, 2)]
    few = [error for error in errors if error.span < 10]
    [whole] = estimate(numbers(counted, *few), checked=order[:10], drawn=order)
    enough = 10 + whole.minutes_to_precision
    assert 20 < enough < 120
    many = [error for error in errors if error.span < enough]
    [whole] = estimate(numbers(counted, *many), checked=order[:enough], drawn=order)
    assert (whole.high - whole.low) / 2 == pytest.approx(0.02 * whole.true, rel=0.15)


@pytest.mark.parametrize("name", SITUATIONS | BURSTS)
def test_intervals_hold_the_truth(name: str) -> None:
    """93 % of many; of 60 samples, chance leaves at least 51 of them once in a thousand tests."""
    for group, results in measure((SITUATIONS | BURSTS)[name], samples=60).items():
        assert sum(result.holds for result in results) >= 51, group


def test_the_page_shows_the_same_numbers(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    cases, expected = [], []
    for checked in (2, 3, 12, 60):
        counted = {
            "car": [int(number) for number in rng.poisson(8, 60)],
            "truck": [int(number) for number in rng.poisson(0.3, 60)],
        }
        traffic = [sum(numbers) for numbers in zip(*counted.values(), strict=True)]
        table = {ALL: traffic} | {VehicleGroup(class_name=n): row for n, row in counted.items()}
        order = draw_spans(traffic, seed=checked)
        kinds = [(), (ALL, CAR), (ALL, VehicleGroup(class_name="truck")), (ALL, BUS)]
        errors = [
            CountError(span, *(kinds[kind] for kind in rng.choice(4, 2, replace=False)))
            for span in order[: checked + 1]
            if rng.random() < 0.7
        ]
        made = numbers(table, *errors)
        strata = strata_of(traffic).tolist()
        rows = [[label(group), of_group.tolist()] for group, of_group in made.items()]
        cases.append({"numbers": rows, "strata": strata, "order": order[:checked]})
        expected.append(estimate(made, order[:checked], order))
    page = tmp_path / "page.html"
    script = (TEMPLATES / "estimate.js").read_text(encoding="utf-8")
    page.write_text(f"<body data-ready=yes><script>{script}</script>", encoding="utf-8")
    with browser(tmp_path) as window:
        window.open(page)
        shown = window.run(
            "return JSON.stringify(arguments[0].map(({ order, numbers, strata }) =>"
            " estimateCounts({ strata, numbers: new Map(numbers), checked: new Set(order),"
            " drawn: new Set(order) })))",
            cases,
        )
    for of_page, in_python in zip(json.loads(shown), expected, strict=True):
        assert [item["group"] for item in of_page] == [label(item.group) for item in in_python]
        for item, exact in zip(of_page, in_python, strict=True):
            item["minutes_to_precision"] = item["minutesToPrecision"]
            for name in ("counted", "corrected", "true", "low", "high", "minutes_to_precision"):
                assert isclose(item[name], getattr(exact, name), rel_tol=1e-9), (item, exact)
