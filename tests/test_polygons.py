"""Points, segments and polygons."""

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from vdet.polygons import (
    Outline,
    Point,
    area_of,
    contains,
    crosses_itself,
    distance_to,
    meeting,
    side_of,
    sides,
    unclosed,
)

SQUARE = ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0))
whole = st.integers(-50, 50).map(float)
points = st.tuples(whole, whole)


@st.composite
def stars(draw: st.DrawFn) -> list[Point]:
    """Give a polygon around a middle, which cannot cross itself, in either order."""
    count = draw(st.integers(3, 9))
    radii = draw(st.lists(st.floats(5, 40), min_size=count, max_size=count))
    turn, order = draw(st.floats(0, 6)), draw(st.sampled_from([1, -1]))
    angles = [turn + order * math.tau * i / count for i in range(count)]
    return [(r * math.cos(a), r * math.sin(a)) for r, a in zip(radii, angles, strict=True)]


class TestSides:
    def test_right_is_below_a_line_to_the_right(self) -> None:
        assert side_of((0, 0), (10, 0), (3, 2)) == 2
        assert side_of((10, 0), (0, 0), (3, 2)) == -2

    @given(points, points, points)
    def test_turning_the_line_round_changes_the_side(self, a: Point, b: Point, p: Point) -> None:
        assume(a != b)
        assert side_of(a, b, p) == pytest.approx(-side_of(b, a, p))

    @given(points, points, points, points)
    def test_a_path_changes_the_side_where_it_meets_the_line(
        self, a: Point, b: Point, p: Point, q: Point
    ) -> None:
        assume(a != b and side_of(a, b, p) * side_of(a, b, q) < 0)
        share = meeting((p, q), (a, b))
        if share is not None:
            at = p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1])
            assert distance_to((a, b), at) == pytest.approx(0, abs=1e-6)
            assert side_of(a, b, at) == pytest.approx(0, abs=1e-6)


class TestMeeting:
    @given(points, points, points, points)
    def test_it_does_not_depend_on_which_way_the_segment_is_given(
        self, a: Point, b: Point, c: Point, d: Point
    ) -> None:
        one, other = meeting((a, b), (c, d)), meeting((a, b), (d, c))
        assert (one is None) == (other is None)
        assert one is None or one == pytest.approx(other)

    def test_the_ends_belong_to_both(self) -> None:
        assert meeting(((0, -1), (0, 0)), ((0, 0), (5, 0))) == 1
        assert meeting(((0, -1), (0, 1)), ((0.1, 0), (5, 0))) is None

    def test_segments_along_one_another_do_not_meet(self) -> None:
        assert meeting(((0, 0), (4, 0)), ((1, 0), (9, 0))) is None


class TestPolygons:
    @given(stars(), points)
    def test_a_point_is_in_a_polygon_whichever_corner_is_first(
        self, corners: list[Point], point: Point
    ) -> None:
        assume(min(distance_to(each, point) for each in sides(corners)) > 1e-6)
        turned = [*corners[2:], *corners[:2]]
        assert contains(corners, point) == contains(turned, point)
        assert contains(corners, point) == contains(corners[::-1], point)

    @given(stars())
    def test_the_middle_is_in_and_what_is_beyond_all_corners_is_out(
        self, corners: list[Point]
    ) -> None:
        assume(len(corners) > 4)  # around it, so that the middle is inside
        assert contains(corners, (0.0, 0.0))
        assert not contains(corners, (41.0, 0.3))
        assert not crosses_itself(corners)
        assert area_of(corners) > 0

    @given(stars(), st.floats(0, 6), st.floats(41, 90), st.booleans())
    def test_a_path_from_outside_to_inside_meets_the_border(
        self, corners: list[Point], angle: float, far: float, outwards: bool
    ) -> None:
        start, end = (0.0, 0.0), (far * math.cos(angle), far * math.sin(angle))
        start, end = (start, end) if outwards else (end, start)
        shifted = [(x + 500, y + 500) for x, y in corners]
        outline = Outline(tuple(shifted), tuple(sides(shifted)), (1e4, 1e4))
        path = ((start[0] + 500, start[1] + 500), (end[0] + 500, end[1] + 500))
        share = outline.meeting(path)
        assert share is not None
        at = tuple(a + share * (b - a) for a, b in zip(*path, strict=True))
        assert outline.distance((at[0], at[1])) == pytest.approx(0, abs=1e-4)

    @pytest.mark.parametrize(
        "corners",
        [
            [(0, 0), (4, 4), (4, 0), (0, 4)],  # a bow tie
            [(0, 0), (4, 0), (4, 4), (2, 0)],  # a corner on another side
            [(0, 0), (4, 0), (0, 0), (0, 4)],  # a corner twice
            [(0, 0), (4, 0), (2, 0), (2, 4)],  # a side back along itself
            [(0, 0), (6, 0), (6, 4), (3, -1), (0, 4)],
        ],
    )
    def test_those_that_cross_or_touch_themselves_are_known(self, corners: list[Point]) -> None:
        assert crosses_itself(corners)

    @pytest.mark.parametrize(
        "corners", [SQUARE, [(0, 0), (2, 0), (4, 0), (4, 4)], [(0, 0), (4, 0), (2, 1), (2, 5)]]
    )
    def test_others_are_left_in_peace(self, corners: list[Point]) -> None:
        assert not crosses_itself(corners)

    def test_a_last_corner_that_repeats_the_first_is_dropped(self) -> None:
        assert unclosed([*SQUARE, SQUARE[0]]) == SQUARE
        assert unclosed(SQUARE) == SQUARE


class TestOutlines:
    def test_sides_along_the_edge_are_no_borders(self) -> None:
        outline = Outline.laid([(0, 300), (1279.4, 300), (1280, 719), (1, 720)], (1280, 720))
        assert outline.borders == (((0, 300), (1280, 300)),)
        assert outline.distance((600, 900)) == pytest.approx(420, abs=0.1)
        assert outline.contains((-50, 800))

    def test_the_distance_is_negative_outside(self) -> None:
        outline = Outline.laid([(100, 100), (200, 100), (200, 200), (100, 200)], (1280, 720))
        assert outline.distance((150, 110)) == pytest.approx(10)
        assert outline.distance((150, 80)) == pytest.approx(-20)
