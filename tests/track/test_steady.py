"""Boxes that do not tremble."""

from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boxing import moved_to
from vdet.boxes import Box
from vdet.track.steady import GAP, LIMIT, SteadyBoxes
from vdet.track.track import Track

SECONDS = 0.4
CAR = Box.sized(300, 200, 200, 160)


def track(box: Box, id_: int = 1) -> Track:
    return Track(id_, box, 0.9, predicted=False, whole_foot=(box.x1 + box.width / 2, box.y2))


def smoothed(boxes: Iterable[Box], rate: float = 25, seconds: float = SECONDS) -> list[Box]:
    steady = SteadyBoxes(seconds)
    shown = [steady.update([track(box)], n / rate) for n, box in enumerate(boxes)]
    return [tracks[0].box for tracks in shown]


def trembling(count: int, seed: int = 1, sides: float = 0.01) -> list[Box]:
    noise = np.random.default_rng(seed).normal(0, sides * CAR.width, (count, 4)).round().astype(int)
    return [
        Box.sized(CAR.x1 + x, CAR.y1 + y, CAR.width + w, CAR.height + h)
        for x, y, w, h in noise.tolist()
    ]


def changes(boxes: Iterable[Box]) -> float:
    """Return the mean change of width from frame to frame."""
    return float(np.abs(np.diff([box.width for box in boxes])).mean())


@pytest.mark.parametrize("rate", [10, 25, 50])
def test_widths_change_by_half_as_much_or_less(rate: int) -> None:
    given = trembling(200)
    assert changes(smoothed(given, rate)[10:]) < 0.5 * changes(given[10:])


@pytest.mark.parametrize("speed", [-12, 0, 12])
def test_a_vehicle_that_moves_and_grows_steadily_is_shown_without_lag(speed: int) -> None:
    given = [Box.sized(600 + speed * n, 200, 200 + 2 * n, 160 + n) for n in range(40)]
    for box, place in zip(smoothed(given)[2:], given[2:], strict=True):
        assert box.iou(place) > 0.98


@given(
    st.lists(
        st.builds(
            Box.sized,
            st.integers(-50, 1300),
            st.integers(-50, 700),
            st.integers(1, 900),
            st.integers(1, 700),
        ),
        min_size=1,
        max_size=20,
    )
)
def test_a_side_never_lies_far_from_where_it_was_given(boxes: list[Box]) -> None:
    for box, place in zip(smoothed(boxes), boxes, strict=True):
        reach, drop = LIMIT * place.width + 0.5, LIMIT * place.height + 0.5
        assert abs(box.x1 - place.x1) <= reach
        assert abs(box.x2 - place.x2) <= reach
        assert abs(box.y1 - place.y1) <= drop
        assert abs(box.y2 - place.y2) <= drop
        assert box.area


def test_the_foot_moves_with_its_box() -> None:
    steady = SteadyBoxes(SECONDS)
    for number, box in enumerate(trembling(20)):
        (shown,) = steady.update([track(box)], number / 25)
        middle = shown.box.x1 + shown.box.width / 2
        assert shown.foot == pytest.approx((middle, shown.box.y2))


def test_a_vehicle_that_comes_back_later_begins_anew() -> None:
    steady = SteadyBoxes(SECONDS)
    for number in range(20):
        steady.update([track(moved_to(CAR, 10 * number, 200))], number / 25)
    (back,) = steady.update([track(CAR)], 1 + GAP + 0.1)
    assert back.box == CAR
