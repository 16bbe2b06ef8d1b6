from pathlib import Path

import pytest

from labels.saving import car, frame, written
from vdet.errors import TruthError
from vdet.labels.kitti import KITTI, read_kitti
from vdet.labels.reading import read_tracks

REST = "1.5 1.6 4.0 2.0 1.5 20.0 -1.6"


def kitti_line(frame: int, track: int, name: str, box: str = "10.5 20 40.5 60") -> str:
    return f"{frame} {track} {name} 0 2 -1.57 {box} {REST}"


def test_what_is_not_known_is_written_as_the_format_says() -> None:
    assert written(KITTI, [frame(4, car())]) == (
        b"4 1 Car -1 -1 -10 10.00 20.00 40.00 60.00 -1 -1 -1 -1000 -1000 -1000 -10 0.7500\n"
    )


def test_read_as_tracks_regions_are_left_out_and_types_are_classes(tmp_path: Path) -> None:
    path = tmp_path / "0000.txt"  # as KITTI calls it
    names = ("Van", "Truck", "Pedestrian", "DontCare")
    lines = [kitti_line(0, -1 if name == "DontCare" else k, name) for k, name in enumerate(names)]
    path.write_text("\n".join(lines))
    (only,) = read_tracks(path)
    assert [track.class_name for track in only.tracks] == ["car", "truck", "person"]


@pytest.mark.parametrize(
    ("second", "message"),
    [
        (
            kitti_line(1, 3, "Car") + " 0.9",
            "KITTI tracking has 17 columns separated by spaces; this line has 18",
        ),
        (kitti_line(1, 3, "Car", "10 20 nan 60"), "'nan' is not a number"),
        (kitti_line(1, 3, "Car").replace("1 3", "1 x", 1), "'x' is not a number"),
    ],
)
def test_a_wrong_line_is_refused_with_its_number(second: str, message: str) -> None:
    with pytest.raises(TruthError) as caught:
        read_kitti(Path("0000.txt"), f"{kitti_line(0, 3, 'Car')}\n{second}".encode())
    assert str(caught.value).startswith(f"0000.txt:2: {message}")
