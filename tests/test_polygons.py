"""Points, segments and polygons."""

from vdet.polygons import meeting, side_of


def test_right_is_below_a_line_to_the_right() -> None:
    assert side_of((0, 0), (10, 0), (3, 2)) == 2
    assert side_of((10, 0), (0, 0), (3, 2)) == -2


class TestMeeting:
    def test_the_ends_belong_to_both(self) -> None:
        assert meeting(((0, -1), (0, 0)), ((0, 0), (5, 0))) == 1
        assert meeting(((0, -1), (0, 1)), ((0.1, 0), (5, 0))) is None

    def test_segments_along_one_another_do_not_meet(self) -> None:
        assert meeting(((0, 0), (4, 0)), ((1, 0), (9, 0))) is None
