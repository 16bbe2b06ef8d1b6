"""The classes of networks, and which of them are wanted."""

from vdet.detect.onnx.detector import class_numbers
from vdet.detect.onnx.network import COCO

WANTED = ("car", "truck", "bus", "vehicle")


def test_names_of_others_are_taken_for_ours() -> None:
    names = ("Van", "lorry", "coach", "person", "vehicle", "trailer", "Two wheeler")
    assert class_numbers(names, WANTED) == [0, 1, 2, -1, 3, -1, -1]
    assert class_numbers(names, (*WANTED, "motorcycle"))[-1] == 4
    others = ("HGV", "LGV", "minibus", "Jeep", "ambulance", "auto", "E-Rickshaw", "tricycle")
    assert class_numbers(others, WANTED) == [1, 0, 2, 0, 0, 3, 3, 3]


def test_any_class_that_the_network_knows_may_be_wanted() -> None:
    numbers = class_numbers(COCO, ("traffic light", "car"))
    assert {name: number for name, number in zip(COCO, numbers, strict=True) if number >= 0} == {
        "traffic light": 0,
        "car": 1,
    }
