"""Packets are kept from a shown key frame on, and no more of them than is needed."""

from typing import Any, cast

from vdet.media.backlog import Backlog


class Packet:
    """As far as a packet is looked at."""

    def __init__(self, pts: int | None, *, key: bool = False, size: int = 100) -> None:
        self.pts = pts
        self.is_keyframe = key
        self.size = size


def packet(pts: int | None, *, key: bool = False, size: int = 100) -> Any:
    return cast(Any, Packet(pts, key=key, size=size))


def filled(packets: list[Any], shown: list[int | None]) -> Backlog:
    backlog = Backlog()
    for each in packets:
        backlog.add(each)
    for pts in shown:
        backlog.show(pts)
    return backlog


def times(backlog: Backlog) -> tuple[list[int | None], int] | None:
    taken = backlog.take()
    return taken and ([each.pts for each in taken[0]], taken[1])


GROUPS = [packet(n, key=n % 4 == 0) for n in range(12)]


def test_nothing_is_forgotten_before_the_next_key_frame_is_shown() -> None:
    assert times(filled(GROUPS, [0, 1, 2, 3])) == (list(range(12)), 4)


def test_what_lies_before_it_is_forgotten_then() -> None:
    assert times(filled(GROUPS, [0, 1, 2, 3, 4])) == (list(range(4, 12)), 1)
    assert times(filled(GROUPS, list(range(10)))) == (list(range(8, 12)), 2)


def test_without_times_pictures_are_counted() -> None:
    timeless = [packet(None, key=n % 4 == 0) for n in range(12)]
    assert times(filled(timeless, [None] * 4)) == ([None] * 12, 4)
    assert times(filled(timeless, [None] * 5)) == ([None] * 8, 1)


def test_what_is_shown_before_the_key_frame_needs_the_frames_before_it() -> None:
    stream = [packet(0, key=True), packet(1), packet(4, key=True), packet(2), packet(3), packet(5)]
    assert times(filled(stream, [0, 1, 2, 3])) == ([0, 1, 4, 2, 3, 5], 4)
    assert times(filled(stream, [0, 1, 2, 3, 4])) == ([4, 5], 3)


def test_a_time_that_is_wrong_costs_no_packet() -> None:
    stream = [*GROUPS[:8], packet(8, key=True), packet(9), packet(1), packet(10)]
    assert times(filled(stream, list(range(9)))) == ([8, 9, 1, 10], 1)


def test_a_stream_may_begin_amid_a_group() -> None:
    assert times(filled(GROUPS[1:3], [1])) == ([1, 2], 1)


def test_too_many_packets_are_given_up_until_a_later_key_frame_is_shown() -> None:
    backlog = filled([packet(n, key=n == 0) for n in range(2000)], list(range(1990)))
    assert backlog.take() is None
    backlog.add(packet(2000, key=True))
    backlog.add(packet(2001))
    assert backlog.take() is None
    backlog.show(2000)
    assert times(backlog) is not None
    assert [each.pts for each in (backlog.take() or ([], 0))[0]] == [2000, 2001]


def test_so_are_too_large_ones() -> None:
    backlog = filled([packet(0, key=True, size=10**7)], [0])
    for n in range(1, 10):
        backlog.add(packet(n, size=10**7))
    assert backlog.take() is None
