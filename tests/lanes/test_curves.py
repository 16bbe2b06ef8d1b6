"""Curves, and their fit to the paint of a frame."""

from dataclasses import replace

import numpy as np
import pytest

from vdet.boxes import Image
from vdet.config.schema import LaneSettings
from vdet.lanes.curves import LaneCurves, fit_near, fit_new
from vdet.lanes.paint import HIDDEN, PAINT
from vdet.lanes.top_view import TopView

TOP_VIEW = TopView(LaneSettings(), 1280, 720)
LAST = LaneCurves(bend=1 / 2000, heading=0.005, left=-1.8, right=1.9, pitch=0.0)
ALL, DASH = np.s_[:], np.s_[200:232]  # four metres


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
