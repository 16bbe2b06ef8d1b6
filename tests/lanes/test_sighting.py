"""The lane in one mask, and whether it is believed."""

import numpy as np
import pytest

from vdet.config.lanes import LaneSettings
from vdet.lanes.curves import Curves
from vdet.lanes.sighting import sight_anew, sight_around
from vdet.lanes.view import View
from vdet.media.images import Image

SETTINGS = LaneSettings()
VIEW = View(SETTINGS.view, 1280, 720)
LAST = Curves(bend=1 / 2000, heading=0.005, left=-1.8, right=1.9, pitch=0.0)
SOLID, DASHED = np.s_[:], np.s_[200:232]  # four metres


def masked(curves: Curves, left: slice = SOLID, right: slice = SOLID, spread: float = 0) -> Image:
    """Draw both lines in some of the rows, the right one's paint scattered by `spread` metres."""
    rng = np.random.default_rng(0)
    mask = np.zeros((len(VIEW.distances), len(VIEW.laterals)), np.uint8)
    for x, rows, wide in zip(curves.at(VIEW.distances), (left, right), (0, spread), strict=True):
        columns = VIEW.columns(x + rng.uniform(-wide, wide, len(x)))
        for row in range(len(mask))[rows]:
            middle = round(float(columns[row]))
            mask[row, middle - 2 : middle + 3] = 255
    return mask


def moved(**changes: float) -> Curves:
    values = {name: getattr(LAST, name) for name in ("bend", "heading", "left", "right", "pitch")}
    return Curves(**(values | changes))


def test_both_lines_are_seen_where_they_are() -> None:
    for sighting in (
        sight_anew(masked(LAST), VIEW, SETTINGS),
        sight_around(masked(LAST), VIEW, moved(left=-1.7, right=2.0), SETTINGS),
    ):
        assert sighting is not None
        assert sighting.seen == (True, True)
        assert sighting.curves.left == pytest.approx(-1.8, abs=0.03)
        assert sighting.curves.width == pytest.approx(3.7, abs=0.03)


def test_a_dash_of_four_metres_is_enough() -> None:
    sighting = sight_anew(masked(LAST, right=DASHED), VIEW, SETTINGS)
    assert sighting is not None
    assert sighting.seen == (True, True)


@pytest.mark.parametrize(
    ("mask", "seen"),
    [
        (masked(LAST, right=np.s_[:0]), (True, False)),
        (masked(LAST, left=np.s_[:20]), (False, True)),
    ],
)
def test_one_line_will_do_around_the_last_lane_but_not_for_a_new_one(
    mask: Image, seen: tuple[bool, bool]
) -> None:
    sighting = sight_around(mask, VIEW, LAST, SETTINGS)
    assert sighting is not None
    assert sighting.seen == seen
    assert sighting.curves.width == pytest.approx(3.7, abs=0.03)
    assert sight_anew(mask, VIEW, SETTINGS) is None


def test_what_is_scattered_about_a_line_is_not_its_paint_and_moves_nothing() -> None:
    mask = masked(moved(right=1.98), spread=0.3)
    sighting = sight_around(mask, VIEW, LAST, SETTINGS)
    assert sighting is not None
    assert sighting.seen == (True, False)
    assert sighting.curves.right == pytest.approx(LAST.right, abs=0.03)


@pytest.mark.parametrize(
    "lane",
    [
        moved(left=-2.4, right=2.4),  # too wide
        moved(left=-1.4, right=1.4),  # too narrow
        moved(bend=1 / 200, heading=-0.1),  # too tight
        moved(pitch=0.02),  # lines that meet
    ],
)
def test_no_road_has_such_a_lane(lane: Curves) -> None:
    assert sight_anew(masked(lane), VIEW, SETTINGS) is None
    assert sight_around(masked(lane), VIEW, lane, SETTINGS) is None


def test_a_lane_that_jumps_aside_is_not_the_last_one() -> None:
    mask = masked(moved(left=-1.38, right=2.32))
    assert sight_around(mask, VIEW, LAST, SETTINGS) is None
    assert sight_anew(mask, VIEW, SETTINGS) is not None


def test_a_lane_beside_the_camera_is_none_to_begin_with() -> None:
    assert sight_anew(masked(moved(left=0.4, right=4.1)), VIEW, SETTINGS) is None
