"""How many vehicles are shown at once."""

from traffic.passing import frame, track
from vdet.boxes import Box
from vdet.traffic.levels import Levels


def levels(*counts: int, rate: float = 25) -> Levels:
    made = Levels()
    for index, count in enumerate(counts):
        tracks = [track(number, Box.sized(9 * number, 5, 8, 8)) for number in range(1, count + 1)]
        made.add(frame(index, *tracks, rate=rate))
    return made


def test_each_step_has_the_most_vehicles_that_are_shown_in_it() -> None:
    made = levels(0, 0, 0, 0, 2, 2, 2, 2, 1, 3, 1, 1, 0)
    assert made.most == 3
    assert list(made.steps(3)) == [0, 2, 3]
    assert list(made.steps(12)) == [0, 0, 0, 0, 2, 2, 2, 2, 1, 3, 1, 1]


def test_of_one_frame_or_none_there_are_levels_too() -> None:
    assert list(levels(2).steps(3)) == [2, 0, 0]
    assert list(levels().steps(3)) == [0, 0, 0]
    assert levels().most == 0
