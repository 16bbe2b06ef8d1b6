"""Points, segments and polygons."""

import pytest

from vdet.polygons import Point, crosses_itself, meeting, side_of

SQUARE = ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0))


def test_right_is_below_a_line_to_the_right() -> None:
    assert side_of((0, 0), (10, 0), (3, 2)) == 2
    assert side_of((10, 0), (0, 0), (3, 2)) == -2


class TestMeeting:
    def test_the_ends_belong_to_both(self) -> None:
        assert meeting(((0, -1), (0, 0)), ((0, 0), (5, 0))) == 1
        assert meeting(((0, -1), (0, 1)), ((0.1, 0), (5, 0))) is None

    def test_segments_along_one_another_do_not_meet(self) -> None:
        assert meeting(((0, 0), (4, 0)), ((1, 0), (9, 0))) is None


class TestPolygons:
    @pytest.mark.parametrize(
        "corners",
        [
            [(0, 0), (4, 4), (4, 0), (0, 4)],  # a bow tie
            [(0, 0), (4, 0), (4, 4), (2, 0)],  # a corner on another side
            [(0, 0), (4, 0), (0, 0), (0, 4)],  # a corner twice
            [(0, 0), (4, 0), (2, 0), (2, 4)],  # a side back along itself
            [(0, 0), (6, 0), (6, 4), (3, -1), (0, 4)],
            [(0, 0), (2, 0), (4, 0)],  # no area
        ],
    )
    def test_those_that_cross_or_touch_themselves_are_known(self, corners: list[Point]) -> None:
        assert crosses_itself(corners)

    @pytest.mark.parametrize(
        "corners", [SQUARE, [(0, 0), (2, 0), (4, 0), (4, 4)], [(0, 0), (4, 0), (2, 1), (2, 5)]]
    )
    def test_others_are_left_in_peace(self, corners: list[Point]) -> None:
        assert not crosses_itself(corners)
