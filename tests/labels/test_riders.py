"""Riders labelled apart from what they ride."""

from vdet.labels.label import Label
from vdet.labels.riders import merge_riders

MACHINE = Label(1, (10, 30, 30, 50), "motorbike")


def test_a_rider_is_part_of_what_he_covers_most() -> None:
    other = Label(2, (27, 30, 47, 50), "bicycle")
    rider = Label(3, (12, 10, 28, 45), "Rider")
    assert merge_riders([rider, MACHINE, other]) == [MACHINE._replace(box=(10, 10, 30, 50)), other]


def test_two_riders_share_a_machine() -> None:
    riders = [Label(2, (10, 10, 20, 40), "rider"), Label(3, (18, 12, 34, 40), "rider")]
    assert merge_riders([MACHINE, *riders]) == [MACHINE._replace(box=(10, 10, 34, 50))]


def test_a_rider_beside_and_a_pedestrian_in_front_of_a_machine_remain() -> None:
    labels = [MACHINE, Label(2, (60, 10, 70, 40), "rider"), Label(3, (12, 10, 28, 45), "person")]
    assert merge_riders(labels) == labels
