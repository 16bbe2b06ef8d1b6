"""Files of records, and the file over those of many videos."""

import json
from pathlib import Path

from running import rows_of
from traffic.passing import WIDTH, frame, passing, summarize, track
from vdet.boxes import Box
from vdet.track.track import FrameTracks
from vdet.traffic.output import read_table, write_content
from vdet.traffic.records import join_records, records_content

HEADING = (
    "id,class,clock,first,last,seconds,detected,interpolated,predicted,mean_score,best_score,"
    "start_x,start_y,end_x,end_y,length,length_fraction,x,y,width,height,metres,speed,speed_85,speed_sd,"
    "motion,distance,lane\n"
)
BOX = Box.sized(-30, 5, 30, 30)
FIRST = "1,,,0.0,1.0,1.04,26,0,0,0.9,0.9,30.0,130.0,80.0,130.0,50.0,0.1562,10,100,40,30,,,,,,,\n"


def written(path: Path, *frames: FrameTracks) -> str:
    write_content(path, records_content(summarize(frames, WIDTH), path))
    return path.read_bytes().decode()


def test_csv_has_a_heading_and_a_row_a_vehicle(tmp_path: Path) -> None:
    assert written(tmp_path / "a.csv", *passing(26)) == HEADING + FIRST
    assert written(tmp_path / "none.csv") == HEADING


def test_json_is_a_list_of_vehicles(tmp_path: Path) -> None:
    truck = frame(
        0, track(3, Box.sized(1, 2, 30, 40), class_name="truck", state="predicted", score=1)
    )
    (item,) = json.loads(written(tmp_path / "a.JSON", truck))
    assert item == {
        "id": 3, "class": "truck", "clock": None, "first": 0, "last": 0, "seconds": 0,
        "detected": 0, "interpolated": 0, "predicted": 1, "mean_score": 1, "best_score": 1,
        "path": {"start": [16, 42], "end": [16, 42], "length": 0, "length_fraction": 0},
        "largest": {"x": 1, "y": 2, "width": 30, "height": 40},
        **dict.fromkeys(("metres", "speed", "speed_85", "speed_sd", "motion", "distance", "lane")),
    }  # fmt: skip
    assert json.loads(written(tmp_path / "none.json")) == []


def test_a_table_is_read_as_it_was_written(tmp_path: Path) -> None:
    rows = [["=in", "-1.5"], ["in, or out", "+"], ["", "@x"]]
    write_content(tmp_path / "a.csv", [("name", "note"), *rows])
    read = read_table(tmp_path / "a.csv", ["name"])
    assert [list(row.values()) for row in read] == rows


class TestJoined:
    NAMES = ("a", "day/b", 'with ", and\nnewline')

    def join(self, folder: Path, suffix: str) -> str:
        bus = [frame(at, track(2, BOX, class_name="bus")) for at in (26, 27, 28)]
        path = folder / f"all{suffix}"
        content = records_content(summarize([*passing(26), *bus], WIDTH), path)
        join_records(dict.fromkeys(self.NAMES, content), path)
        return path.read_text(encoding="utf-8")

    def test_each_row_has_its_video(self, tmp_path: Path) -> None:
        text = self.join(tmp_path, ".csv")
        assert text.startswith(f"video,{HEADING}a,{FIRST}a,2,bus,")
        rows = rows_of(tmp_path / "all.csv")
        assert [row["video"] for row in rows] == [name for name in self.NAMES for _ in range(2)]

    def test_no_cell_is_a_formula(self, tmp_path: Path) -> None:
        names = ("=cmd|' /C calc'!A1", "+1+cmd", "-2+3", "@SUM(A1)", "\t=1+1")
        tracks = (track(number, BOX, class_name=name) for number, name in enumerate(names))
        path = tmp_path / "all.csv"
        join_records({"=1+1": records_content(summarize([frame(0, *tracks)], WIDTH), path)}, path)
        rows = rows_of(path)
        assert [row["class"] for row in rows] == [f"'{name}" for name in names]
        assert {row["video"] for row in rows} == {"'=1+1"}
        assert {row["start_x"] for row in rows} == {"-15.0"}, "numbers stay numbers"
