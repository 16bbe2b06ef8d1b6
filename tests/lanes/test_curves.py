"""Curves, and their fit to paint."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from vdet.lanes.curves import LaneCurves, NormalEquations, normal_equations, solve
from vdet.lanes.paint import LinePaint

Z = np.linspace(6, 42, 200)
SOLID, DASHED = slice(None), slice(60, 110)

any_lane = st.builds(
    LaneCurves,
    bend=st.floats(-1 / 400, 1 / 400),
    heading=st.floats(-0.05, 0.05),
    left=st.floats(-2.5, -1.2),
    right=st.floats(1.2, 2.5),
    pitch=st.floats(-0.006, 0.006),
)


def equations_of(curves: LaneCurves, right: slice = SOLID, noise: float = 0.0) -> NormalEquations:
    left_x, right_x = curves.at(Z) + np.random.default_rng(0).normal(0, noise, (2, len(Z)))
    guess = LaneCurves(curves.bend, curves.heading, curves.left, curves.right, curves.pitch)
    return normal_equations(LinePaint(Z, left_x), LinePaint(Z[right], right_x[right]), guess)


@given(any_lane, st.floats(8, 35))
def test_pitch_moves_road_points_as_a_tilted_camera_sees_them(
    curves: LaneCurves, true_distance: float
) -> None:
    apparent = true_distance / (1 + curves.pitch * true_distance)  # all rows move alike
    level = LaneCurves(curves.bend, curves.heading, curves.left, curves.right, 0)
    true = level.at(np.array([true_distance]))
    seen = curves.at(np.array([apparent]))
    for there, here in zip(true, seen, strict=True):
        assert here / apparent == pytest.approx(there / true_distance)  # the same column


@given(any_lane)
@example(LaneCurves(bend=1 / 400, heading=0.0, left=-1.5, right=1.5, pitch=0.005859375))
@example(LaneCurves(bend=-1 / 400, heading=-0.05, left=-1.2, right=2.5, pitch=0.006))
def test_the_fit_to_the_paint_of_a_lane_is_that_lane(curves: LaneCurves) -> None:
    found = solve(equations_of(curves), curves.width)
    for line, truth in zip(found.at(Z), curves.at(Z), strict=True):
        assert line == pytest.approx(truth, abs=0.05)
    assert 2 * found.bend == pytest.approx(2 * curves.bend, abs=1e-4)


def test_one_dash_is_enough_for_the_second_line() -> None:
    curves = LaneCurves(1 / 1600, 0.01, -1.8, 1.9, 0.002)
    found = solve(equations_of(curves, DASHED, noise=0.03), 3.7)
    for line, truth in zip(found.at(Z), curves.at(Z), strict=True):
        assert line == pytest.approx(truth, abs=0.15)


def test_an_unseen_line_is_placed_at_the_known_width() -> None:
    curves = LaneCurves(1 / 1600, 0.01, -1.8, 1.9, 0.0)
    found = solve(equations_of(curves, slice(0)), width=3.5)
    assert found.left == pytest.approx(-1.8, abs=0.05)
    assert found.width == pytest.approx(3.5, abs=0.01)


def test_without_paint_the_lane_is_straight_and_has_the_known_width() -> None:
    empty = LinePaint(np.empty(0), np.empty(0))
    found = solve(normal_equations(empty, empty, LaneCurves(0, 0, -1, 1, 0)), width=3.7)
    assert (found.bend, found.heading, found.pitch) == (0, 0, 0)
    assert found.width == pytest.approx(3.7, abs=0.1)


def test_the_pitch_of_earlier_frames_is_ignored() -> None:
    nodding, level = (LaneCurves(0, 0, -1.85, 1.85, pitch) for pitch in (0.005, 0.0))
    both = equations_of(level).plus_earlier(equations_of(nodding), 0.9)
    assert solve(both, 3.7).pitch == pytest.approx(0, abs=2e-4)


@pytest.mark.parametrize(("left", "right", "contained"), [(-1, 2, True), (0.1, 3, False)])
def test_the_camera_is_in_a_lane_with_lines_on_both_sides_of_it(
    left: float, right: float, contained: bool
) -> None:
    assert LaneCurves(0, 0, left, right, 0).contain_camera is contained
