"""What counts as lost, and what a whole file may leave out."""

from fractions import Fraction
from types import SimpleNamespace
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from vdet.media.decoder import Damage


def thing(pts: int | None) -> Any:
    """Return what is read of a packet or a picture."""
    return SimpleNamespace(pts=pts, is_corrupt=False, is_discard=False, interlaced_frame=False)


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


def test_a_gap_in_the_times_counts_the_pictures_without_a_packet() -> None:
    some = at(*range(7), *range(12, 20))
    assert counted(some, some, errors=1).damaged == 5


def test_in_damage_a_late_picture_is_not_usable() -> None:
    damage = Damage(Fraction(PERIOD), paired=True)
    damage.fail_to_decode()
    assert [damage.receive(picture) for picture in at(3, 5, 4, 5, 6)] == [
        True, True, False, False, True,
    ]  # fmt: skip


class TestBytes:
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
