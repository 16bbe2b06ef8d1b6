"""What counts as lost, and what a whole file may leave out."""

from fractions import Fraction
from typing import Any, cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdet.media.damage import Damage


class Thing:
    """What is read of a packet or a picture."""

    def __init__(self, pts: int | None, *, corrupt: bool, discard: bool, interlaced: bool) -> None:
        self.pts = pts
        self.is_corrupt = corrupt
        self.is_discard = discard
        self.interlaced_frame = interlaced


def thing(
    pts: int | None, *, corrupt: bool = False, discard: bool = False, interlaced: bool = False
) -> Any:
    return cast(Any, Thing(pts, corrupt=corrupt, discard=discard, interlaced=interlaced))


PERIOD = 10


def counted(
    sent: list[Any], received: list[Any], *, errors: int = 0, paired: bool = True
) -> Damage:
    damage = Damage(Fraction(PERIOD), paired=paired)
    for packet in sent:
        damage.send(packet)
    for _ in range(errors):
        damage.fail_to_decode()
    for picture in received:
        damage.receive(picture)
    damage.finish()
    return damage


def at(*numbers: int) -> list[Any]:
    return [thing(PERIOD * number) for number in numbers]


ALL = at(*range(20))


def test_a_whole_stream_has_lost_nothing() -> None:
    damage = counted(ALL, ALL)
    assert (damage.damaged, damage.total, damage.evident) == (0, 20, False)


def test_a_packet_without_a_picture_is_lost_if_there_was_an_error() -> None:
    damage = counted(ALL, at(*range(7), *range(9, 20)), errors=1)
    assert (damage.damaged, damage.lost, damage.total) == (2, 2, 20)


def test_a_packet_without_a_picture_is_not_lost_if_there_was_no_error() -> None:
    damage = counted(ALL, at(*range(7), *range(9, 20)))
    assert (damage.damaged, damage.total, damage.skipped) == (0, 18, 2)


def test_a_gap_in_the_times_counts_the_pictures_without_a_packet() -> None:
    some = at(*range(7), *range(12, 20))
    assert counted(some, some, errors=1).damaged == 5


def test_in_damage_a_late_picture_is_not_usable() -> None:
    damage = Damage(Fraction(PERIOD), paired=True)
    damage.fail_to_decode()
    assert [damage.receive(picture) for picture in at(3, 5, 4, 5, 6)] == [
        True, True, False, False, True,
    ]  # fmt: skip


def test_gaps_in_irregular_times_are_not_counted() -> None:
    uneven = at(0, 1, 5, 6, 9, 14, 15, 20, 26, 27)
    damage = counted(uneven, uneven, errors=1)
    assert (damage.skipped, damage.damaged) == (0, 1)


def test_pictures_shown_with_errors_are_damaged() -> None:
    pictures = [*ALL[:5], thing(50, corrupt=True), *ALL[6:]]
    damage = counted(ALL, pictures)
    assert (damage.damaged, damage.lost, damage.total) == (1, 0, 20)


@pytest.mark.parametrize(
    ("received", "paired"),
    [(at(*range(0, 20, 2)), False), ([thing(n * 20, interlaced=True) for n in range(10)], True)],
)
def test_packets_and_pictures_are_not_compared_where_they_do_not_pair(
    received: list[Any], paired: bool
) -> None:
    damage = Damage(Fraction(20), paired=paired)
    for packet in ALL:
        damage.send(packet)
    damage.fail_to_decode()
    for picture in received:
        damage.receive(picture)
    damage.finish()
    assert damage.damaged == 1


def test_a_packet_that_is_decoded_again_fails_once() -> None:
    damage = Damage(Fraction(PERIOD), paired=False)
    damage.fail_to_decode()
    damage.decode_errors = 0
    assert (damage.damaged, damage.evident) == (0, True)
    damage.fail_to_decode()
    assert damage.damaged == 1


class TestBytes:
    def test_packets_side_by_side_are_no_evidence_of_damage(self) -> None:
        damage = Damage(Fraction(PERIOD), paired=True)
        for position in range(1000, 100_000, 500):
            damage.pass_bytes(position, 490)
        assert not damage.evident
        assert not damage.end(7, 100_000)
        assert damage.damaged == 0

    def test_pictures_missing_at_the_end_are_lost_if_the_file_goes_on(self) -> None:
        damage = counted(ALL, ALL)
        damage.pass_bytes(1000, 500)
        assert damage.end(7, 3000)
        assert (damage.damaged, damage.total) == (7, 27)


@given(
    st.lists(st.none() | st.integers(-1000, 1000), max_size=30),
    st.lists(st.none() | st.integers(-1000, 1000), max_size=30),
    st.integers(0, 3),
)
def test_no_more_pictures_are_damaged_than_there_are(
    sent: list[int | None], received: list[int | None], errors: int
) -> None:
    damage = counted([thing(t) for t in sent], [thing(t) for t in received], errors=errors)
    assert 0 <= damage.damaged <= damage.total
