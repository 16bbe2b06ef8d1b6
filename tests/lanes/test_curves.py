"""Curves, and their fit to the paint of a frame."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from vdet.boxes import Image
from vdet.config.schema import LaneSettings
from vdet.lanes.curves import (
    Equations,
    LaneCurves,
    add_earlier,
    fit_near,
    fit_new,
    normal_equations,
    solve,
)
from vdet.lanes.paint import HIDDEN, PAINT, LinePaint
from vdet.lanes.top_view import TopView

Z = np.linspace(6, 42, 200)
TOP_VIEW = TopView(LaneSettings(), 1280, 720)
LAST = LaneCurves(bend=1 / 2000, heading=0.005, left=-1.8, right=1.9, pitch=0.0)
ALL, DASH = np.s_[:], np.s_[200:232]  # four metres

any_lane = st.builds(
    LaneCurves,
    bend=st.floats(-1 / 400, 1 / 400),
    heading=st.floats(-0.05, 0.05),
    left=st.floats(-2.5, -1.2),
    right=st.floats(1.2, 2.5),
    pitch=st.floats(-0.006, 0.006),
)


def equations_of(curves: LaneCurves, right: slice = ALL, noise: float = 0.0) -> Equations:
    left_x, right_x = curves.at(Z) + np.random.default_rng(0).normal(0, noise, (2, len(Z)))
    return normal_equations(LinePaint(Z, left_x), LinePaint(Z[right], right_x[right]), curves)


@given(any_lane, st.floats(8, 35))
def test_curves_are_where_a_tilted_camera_sees_the_road(
    curves: LaneCurves, true_distance: float
) -> None:
    apparent = true_distance / (1 + curves.pitch * true_distance)  # all rows move alike
    bend = curves.heading * true_distance + curves.bend * true_distance**2
    seen = curves.at(np.array([apparent]))
    for position, here in zip((curves.left, curves.right), seen, strict=True):
        there = position + bend
        assert here / apparent == pytest.approx(there / true_distance)  # the same column


@given(any_lane)
@example(LaneCurves(bend=1 / 400, heading=0.0, left=-1.5, right=1.5, pitch=0.005859375))
@example(LaneCurves(bend=-1 / 400, heading=-0.05, left=-1.2, right=2.5, pitch=0.006))
def test_the_fit_to_the_paint_of_a_lane_is_that_lane(curves: LaneCurves) -> None:
    found = solve(equations_of(curves), curves.width)
    assert np.array(found.at(Z)) == pytest.approx(np.array(curves.at(Z)), abs=0.05)
    assert 2 * found.bend == pytest.approx(2 * curves.bend, abs=1e-4)


def test_the_pitch_of_earlier_frames_is_ignored() -> None:
    nodding, level = (LaneCurves(0, 0, -1.85, 1.85, pitch) for pitch in (0.005, 0.0))
    both = add_earlier(equations_of(level), equations_of(nodding), 0.9)
    assert solve(both, 3.7).pitch == pytest.approx(0, abs=2e-4)


def masked(curves: LaneCurves, left: slice = ALL, right: slice = ALL, spread: float = 0) -> Image:
    """Draw both lines in some of the rows, the right one's paint scattered by `spread` metres."""
    rng = np.random.default_rng(0)
    mask = np.zeros((len(TOP_VIEW.distances), len(TOP_VIEW.laterals)), np.uint8)
    for x, rows, wide in zip(
        curves.at(TOP_VIEW.distances), (left, right), (0, spread), strict=True
    ):
        columns = TOP_VIEW.columns(x + rng.uniform(-wide, wide, len(x)))
        for row in range(len(mask))[rows]:
            middle = round(float(columns[row]))
            mask[row, middle - 2 : middle + 3] = PAINT
    return mask


@pytest.mark.parametrize(
    ("hidden", "rows", "seen"),
    [
        (0, 28, False),
        (150, 28, True),  # half of the line is hidden: 2 m of paint are enough
        (150, 12, False),
        (240, 6, False),  # if less than a quarter is visible, 1 m is still needed
        (240, 10, True),
    ],
)
def test_less_paint_is_enough_for_a_line_that_vehicles_hide_in_part(
    hidden: int, rows: int, *, seen: bool
) -> None:
    mask = masked(LAST, right=np.s_[260 : 260 + rows])
    mask[:hidden] = HIDDEN
    fit = fit_near(mask, TOP_VIEW, LAST)
    assert fit is not None
    assert fit.seen == (True, seen)


@pytest.mark.parametrize(
    ("mask", "seen"),
    [
        (masked(LAST, right=np.s_[:0]), (True, False)),
        (masked(LAST, left=np.s_[:20]), (False, True)),
        (masked(replace(LAST, right=1.98), spread=0.3), (True, False)),  # scattered paint
    ],
)
def test_one_seen_line_is_enough_near_the_last_lane_but_not_for_a_new_one(
    mask: Image, seen: tuple[bool, bool]
) -> None:
    fit = fit_near(mask, TOP_VIEW, LAST)
    assert fit is not None
    assert fit.seen == seen
    assert fit.curves.right == pytest.approx(LAST.right, abs=0.03)
    assert fit.curves.width == pytest.approx(3.7, abs=0.03)
    assert fit_new(mask, TOP_VIEW) is None


@pytest.mark.parametrize(
    "lane",
    [
        replace(LAST, left=-2.4, right=2.4),  # too wide
        replace(LAST, left=-1.4, right=1.4),  # too narrow
        replace(LAST, bend=1 / 200, heading=-0.1),  # too tight
        replace(LAST, pitch=0.02),  # lines that meet
    ],
)
def test_implausible_lanes_are_rejected(lane: LaneCurves) -> None:
    assert fit_new(masked(lane), TOP_VIEW) is None
    assert fit_near(masked(lane), TOP_VIEW, lane) is None


def test_a_lane_that_jumps_sideways_is_not_the_last_lane() -> None:
    mask = masked(replace(LAST, left=-1.38, right=2.32))
    assert fit_near(mask, TOP_VIEW, LAST) is None
    assert fit_new(mask, TOP_VIEW) is not None


def test_a_new_lane_must_contain_the_camera() -> None:
    assert fit_new(masked(replace(LAST, left=0.4, right=4.1)), TOP_VIEW) is None
