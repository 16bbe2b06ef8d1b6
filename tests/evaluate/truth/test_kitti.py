from pathlib import Path

import pytest

from vdet.errors import TruthError
from vdet.evaluate.rows import Row
from vdet.evaluate.truth.kitti import kitti_rows

FILE = Path("0000.txt")
REST = "1.5 1.6 4.0 2.0 1.5 20.0 -1.6"


def line(frame: int, track: int, name: str, box: str = "10.5 20 40.5 60") -> str:
    return f"{frame} {track} {name} 0 2 -1.57 {box} {REST}"


def test_frames_count_from_0_in_the_file_and_sides_are_corners() -> None:
    assert list(kitti_rows(FILE, line(0, 3, "Car"))) == [Row(1, 1, 3, 10.5, 20, 30, 40)]


def test_car_van_and_truck_are_vehicles() -> None:
    text = "\n".join(line(0, track, name) for track, name in enumerate(["Car", "Van", "Truck"]))
    assert [row.ignored for row in kitti_rows(FILE, text)] == [False] * 3


def test_dontcare_is_an_ignore_region() -> None:
    assert [row.ignored for row in kitti_rows(FILE, line(0, -1, "DontCare"))] == [True]


def test_people_are_neither_vehicles_nor_ignore_regions() -> None:
    assert not list(kitti_rows(FILE, line(0, 1, "Pedestrian") + "\n" + line(0, 2, "Cyclist")))


@pytest.mark.parametrize(
    ("second", "message"),
    [
        (
            line(1, 3, "Car") + " 0.9",
            "KITTI tracking has 17 columns between spaces; this line has 18",
        ),
        ("2,7,1,1,20,10,1,3,1", "KITTI tracking has 17 columns between spaces; this line has 1"),
        (line(1, 3, "Spaceship"), "label 'Spaceship' is unknown"),
        (line(1, 3, "Car", "10 20 nan 60"), "'nan' is not a number"),
    ],
)
def test_a_wrong_line_is_refused_by_its_number(second: str, message: str) -> None:
    with pytest.raises(TruthError) as caught:
        list(kitti_rows(FILE, line(0, 3, "Car") + "\n" + second))
    assert str(caught.value).startswith(f"0000.txt:2: {message}")
