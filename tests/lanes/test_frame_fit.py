"""The lane fitted to one mask, and the checks of the fit."""

import numpy as np
import pytest

from vdet.config.lanes import LaneSettings
from vdet.lanes.curves import LaneCurves
from vdet.lanes.frame_fit import fit_near, fit_new
from vdet.lanes.paint import HIDDEN
from vdet.lanes.top_view import TopView
from vdet.media.images import Image

SETTINGS = LaneSettings()
TOP_VIEW = TopView(SETTINGS, 1280, 720)
LAST = LaneCurves(bend=1 / 2000, heading=0.005, left=-1.8, right=1.9, pitch=0.0)
SOLID, DASHED = np.s_[:], np.s_[200:232]  # four metres


def masked(
    curves: LaneCurves, left: slice = SOLID, right: slice = SOLID, spread: float = 0
) -> Image:
    """Draw both lines in some of the rows, the right one's paint scattered by `spread` metres."""
    rng = np.random.default_rng(0)
    mask = np.zeros((len(TOP_VIEW.distances), len(TOP_VIEW.laterals)), np.uint8)
    for x, rows, wide in zip(
        curves.at(TOP_VIEW.distances), (left, right), (0, spread), strict=True
    ):
        columns = TOP_VIEW.columns(x + rng.uniform(-wide, wide, len(x)))
        for row in range(len(mask))[rows]:
            middle = round(float(columns[row]))
            mask[row, middle - 2 : middle + 3] = 255
    return mask


def moved(**changes: float) -> LaneCurves:
    values = {name: getattr(LAST, name) for name in ("bend", "heading", "left", "right", "pitch")}
    return LaneCurves(**(values | changes))


def test_both_lines_are_fitted_where_they_are() -> None:
    for fit in (
        fit_new(masked(LAST), TOP_VIEW, SETTINGS),
        fit_near(masked(LAST), TOP_VIEW, moved(left=-1.7, right=2.0), SETTINGS),
    ):
        assert fit is not None
        assert fit.seen == (True, True)
        assert fit.curves.left == pytest.approx(-1.8, abs=0.03)
        assert fit.curves.width == pytest.approx(3.7, abs=0.03)


@pytest.mark.parametrize(
    ("hidden", "rows", "seen"),
    [
        (0, 28, False),
        (150, 28, True),  # half of the line is hidden: 2 m of paint are enough
        (150, 12, False),
        (240, 6, False),  # of less than a quarter no less than 1 m is enough
        (240, 10, True),
    ],
)
def test_of_a_line_that_vehicles_hide_in_part_less_paint_is_enough(
    hidden: int, rows: int, *, seen: bool
) -> None:
    mask = masked(LAST, right=np.s_[260 : 260 + rows])
    mask[:hidden] = HIDDEN
    fit = fit_near(mask, TOP_VIEW, LAST, SETTINGS)
    assert fit is not None
    assert fit.seen == (True, seen)


@pytest.mark.parametrize(
    ("mask", "seen"),
    [
        (masked(LAST, right=np.s_[:0]), (True, False)),
        (masked(LAST, left=np.s_[:20]), (False, True)),
    ],
)
def test_one_seen_line_is_enough_near_the_last_lane_but_not_for_a_new_one(
    mask: Image, seen: tuple[bool, bool]
) -> None:
    fit = fit_near(mask, TOP_VIEW, LAST, SETTINGS)
    assert fit is not None
    assert fit.seen == seen
    assert fit.curves.width == pytest.approx(3.7, abs=0.03)
    assert fit_new(mask, TOP_VIEW, SETTINGS) is None


def test_scattered_paint_is_not_a_line_and_does_not_move_it() -> None:
    mask = masked(moved(right=1.98), spread=0.3)
    fit = fit_near(mask, TOP_VIEW, LAST, SETTINGS)
    assert fit is not None
    assert fit.seen == (True, False)
    assert fit.curves.right == pytest.approx(LAST.right, abs=0.03)


@pytest.mark.parametrize(
    "lane",
    [
        moved(left=-2.4, right=2.4),  # too wide
        moved(left=-1.4, right=1.4),  # too narrow
        moved(bend=1 / 200, heading=-0.1),  # too tight
        moved(pitch=0.02),  # lines that meet
    ],
)
def test_implausible_lanes_are_rejected(lane: LaneCurves) -> None:
    assert fit_new(masked(lane), TOP_VIEW, SETTINGS) is None
    assert fit_near(masked(lane), TOP_VIEW, lane, SETTINGS) is None


def test_a_lane_that_jumps_sideways_is_not_the_last_lane() -> None:
    mask = masked(moved(left=-1.38, right=2.32))
    assert fit_near(mask, TOP_VIEW, LAST, SETTINGS) is None
    assert fit_new(mask, TOP_VIEW, SETTINGS) is not None
