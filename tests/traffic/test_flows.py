"""Flows from one line or zone to another, and tables by interval."""

import json
from collections.abc import Callable
from dataclasses import asdict, replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from running import rows_of
from traffic.scenes import ZONE, counts, frames, joined, named, numbered, through
from vdet.config.scene import LineSettings
from vdet.errors import ConfigError
from vdet.findings import Finding
from vdet.track.track import FrameTracks
from vdet.traffic.clock import Clock
from vdet.traffic.counts import Counts, flow_table, per_hour, zone_table
from vdet.traffic.output import counts_content, flows_content, write_content

WEST = LineSettings(name="west", start=(200, 200), end=(200, 600))
EAST = LineSettings(name="east", start=(1000, 200), end=(1000, 600))
SOUTH = LineSettings(name="=south", start=(400, 550), end=(800, 550))

GOES_EAST = through((0, 100, 400), (10, 1100, 400))  # west at 1 s, the zone at 3 s, east at 9 s
TURNS_SOUTH = through((0, 100, 400), (5, 600, 400), (8, 600, 700))
TURNS_BACK = through((0, 100, 400), (3, 400, 350), (6, 100, 300))
BEGINS = datetime.fromisoformat("2026-05-01 07:04:57+02:00")


def crossing(*shapes: LineSettings) -> Counts:
    video = frames(GOES_EAST, TURNS_SOUTH, TURNS_BACK)
    return counts(video, *(shapes or (WEST, EAST, SOUTH)))


def at(counted: Counts, begin: datetime = BEGINS) -> Counts:
    return replace(counted, clock=Clock(begin, "as given", begin.tzinfo))


def test_a_flow_leads_from_the_first_line_of_a_vehicle_to_the_last() -> None:
    rows = crossing().flows()
    assert [(row.origin, row.destination, row.count) for row in rows] == [
        ("west", "west", 1), ("west", "east", 1), ("west", "=south", 1),
    ]  # fmt: skip
    assert {(row.start, row.end, row.class_name) for row in rows} == {(0, 10, "vehicle")}


def test_a_zone_is_a_place_that_is_visited() -> None:
    to_zone = through((0, 100, 400), (5, 600, 400), (10, 620, 400))
    found = counts(frames(GOES_EAST, to_zone), WEST, EAST, ZONE).flows()
    assert [(row.origin, row.destination) for row in found] == [("west", "east"), ("west", "zone")]
    (alone,) = counts(frames(GOES_EAST), ZONE).flows()
    assert (alone.origin, alone.destination) == ("zone", None), "leaving it is no second visit"


def test_a_line_and_a_zone_can_be_left_out_of_flows() -> None:
    line = EAST.model_copy(update={"flows": False})
    zone = ZONE.model_copy(update={"flows": False})
    found = counts(frames(GOES_EAST), WEST, line, zone)
    assert [(row.origin, row.destination) for row in found.flows()] == [("west", None)]
    assert [total.count for total in found.totals] == [1, 0, 1, 0, 1, 1, 0, 0]


def test_counts_are_a_table_of_pandas() -> None:
    pytest.importorskip("pandas")
    found = counts(frames(GOES_EAST), WEST)
    table = found.to_pandas(5).astype(object)
    assert table.where(table.notna(), None).to_dict("records") == [
        asdict(row) for row in found.table(5)
    ]


class TestSeveralVideos:
    def test_they_have_one_table_by_the_clock(self) -> None:
        first = at(crossing(EAST))
        again = counts(numbered(frames(GOES_EAST), 1), EAST)
        event = replace(again.events[0], vehicle=9)
        second = at(replace(again, events=(event,)), BEGINS + timedelta(minutes=10))
        rows = flow_table([first, second], 300)
        assert [(f"{row.start:%H:%M}", row.count) for row in rows] == [
            ("07:00", 0), ("07:05", 1), ("07:10", 0), ("07:15", 1),
        ]  # fmt: skip

    def test_without_clocks_they_have_totals_but_no_intervals(self) -> None:
        several = [crossing(EAST), replace(crossing(EAST), events=())]
        (row,) = flow_table(several)
        assert (row.start, row.end, row.count) == (None, None, 1)
        with pytest.raises(ConfigError, match=r"set input.begin"):
            flow_table(several, 300)

    def test_the_use_of_a_zone_is_a_mean_over_the_time_of_video(self) -> None:
        first = at(counts(frames(GOES_EAST), ZONE))
        second = at(replace(first, events=()), BEGINS + timedelta(hours=1))
        (row,) = zone_table([first, second])
        assert row.mean == pytest.approx(4 / 20, abs=0.01)


class TestIntervals:
    """There is a row for each interval in which there is video, and for no other."""

    def test_a_video_that_ends_at_a_border_before_a_pause(self) -> None:
        begin = datetime.fromisoformat("2026-05-01 07:04:50+02:00")  # its last frame is at 07:05
        first = at(counts(frames(GOES_EAST), ZONE), begin)
        second = at(first, begin + timedelta(minutes=13))
        rows = zone_table([first, replace(second, events=())], 300)
        assert [(f"{row.start:%H:%M}", row.entered, row.mean) for row in rows] == [
            ("07:00", 1, pytest.approx(0.4, abs=0.01)), ("07:05", 0, 0), ("07:15", 0, 0),
        ]  # fmt: skip

    @pytest.mark.parametrize("boxes", [[], [*frames(TURNS_BACK)][:1]], ids=["none", "one"])
    def test_a_video_with_hardly_a_box_beside_one_with_many(self, boxes: list[FrameTracks]) -> None:
        first, night = at(counts(frames(GOES_EAST), ZONE)), at(counts(boxes, ZONE))
        rows = zone_table(
            [first, replace(night, clock=Clock(BEGINS + timedelta(hours=3), "", BEGINS.tzinfo))],
            3600,
        )
        assert [(f"{row.start:%H:%M}", row.entered, row.mean) for row in rows] == [
            ("07:00", 1, pytest.approx(0.4, abs=0.01)), ("10:00", 0, 0),
        ]  # fmt: skip

    def test_a_jump_of_the_times_has_no_intervals(self) -> None:
        late = [
            replace(frame, index=frame.index + 251, time=frame.time + 1.77e9)
            for frame in frames(TURNS_BACK)
        ]
        counted = counts([*frames(GOES_EAST), *numbered(late, 2)], WEST, ZONE)
        assert [row.start for row in counted.zone_use(3600)] == [0, 1.77e9 // 3600 * 3600]
        assert [(row.start, row.origin, row.count) for row in counted.flows(60) if row.count] == [
            (0, "west", 1), (1.77e9, "west", 1),
        ]  # fmt: skip

    def test_frames_that_a_file_leaves_out_are_video(self) -> None:
        """A file of boxes has no frames of a quiet hour."""
        late = [
            replace(frame, index=frame.index + 90_000, time=frame.time + 3600)
            for frame in frames(TURNS_BACK)
        ]
        rows = counts([*frames(GOES_EAST), *numbered(late, 2)], ZONE).zone_use(1200)
        assert [row.start for row in rows] == [0, 1200, 2400, 3600]


def test_less_than_a_minute_of_video_has_no_rate() -> None:
    assert [per_hour(6, seconds) for seconds in (0, 59.9, 60)] == [None, None, 360.0]


class TestFiles:
    @staticmethod
    def write(make: Callable[..., Any], path: Path, *arguments: Any) -> None:
        write_content(path, make(path, *arguments))

    def test_the_table_of_flows_is_tidy_and_has_no_formulas(self, tmp_path: Path) -> None:
        self.write(flows_content, tmp_path / "f.csv", {"v": at(crossing())}, 900)
        assert rows_of(tmp_path / "f.csv")[-1] == {
            "start": "2026-05-01 07:00:00.000+02:00", "end": "2026-05-01 07:15:00.000+02:00",
            "from": "west", "to": "'=south", "class": "vehicle", "count": "1",
            "observed": "10.0", "part": "True", "per_hour": "",
        }  # fmt: skip
        self.write(flows_content, tmp_path / "g.csv", {"v": crossing(EAST)})
        assert [row["to"] for row in rows_of(tmp_path / "g.csv")] == ["(none)"]

    def test_the_matrix_has_every_name_in_both_ways(self, tmp_path: Path) -> None:
        nothing = {"west": 0, "east": 0, "=south": 0, "(none)": 0}
        self.write(flows_content, tmp_path / "f.json", {"v": crossing()}, 5)
        assert json.loads((tmp_path / "f.json").read_text())["matrix"] == {
            "west": {"west": 1, "east": 1, "=south": 1, "(none)": 0},
            "east": nothing,
            "=south": nothing,
        }

    def test_the_wide_table_has_a_column_for_each_class_of_the_settings(
        self, tmp_path: Path
    ) -> None:
        cars = named(frames(GOES_EAST), "car")
        truck = named(numbered(frames(TURNS_BACK), 2), "all")  # which is not a sum
        counted = {"v": replace(counts(joined(cars, truck), WEST), classes=("car", "bus"))}
        self.write(flows_content, tmp_path / "f.wide.csv", counted, 5)
        assert (tmp_path / "f.wide.csv").read_text() == (
            'start,end,"west to west, car","west to west, bus","west to west, all",'
            '"west to west, all","west to (none), car","west to (none), bus","west to (none), all",'
            '"west to (none), all",all\n'
            "0.0,5.0,0,0,1,1,1,0,0,1,2\n"
            "5.0,10.0,0,0,0,0,0,0,0,0,0\n"
            "10.0,15.0,0,0,0,0,0,0,0,0,0\n"
            "all,,0,0,1,1,1,0,0,1,2\n"
        )
        self.write(counts_content, tmp_path / "c.wide.csv", counted)
        assert (tmp_path / "c.wide.csv").read_text() == (
            'start,end,"west: left, car","west: left, bus","west: left, all","west: left, all",'
            '"west: right, car","west: right, bus","west: right, all","west: right, all"\n'
            "0.0,10.0,1,0,1,2,0,0,1,1\n"
            "all,,1,0,1,2,0,0,1,1\n"
        )

    def test_json_has_flows_matrix_and_the_beginning(self, tmp_path: Path) -> None:
        note = Finding("line", "gate: no vehicle crossed this line", severity="note")
        counted = replace(at(crossing(EAST)), findings=(note,))
        self.write(flows_content, tmp_path / "f.json", {"v": counted})
        whole = json.loads((tmp_path / "f.json").read_text())
        assert whole == {
            "interval": None,
            "flows": [
                {
                    "start": "2026-05-01 07:04:57.000+02:00",
                    "end": "2026-05-01 07:05:07.000+02:00",
                    "from": "east", "to": None, "class": "vehicle", "count": 1,
                    "observed": 10.0, "part": False, "per_hour": None,
                },
            ],
            "matrix": {"east": {"east": 0, "(none)": 1}},
            "begin": "2026-05-01 07:04:57.000+02:00",
            "warnings": [],
            "notes": ["gate: no vehicle crossed this line [line]"],
        }  # fmt: skip

    def test_totals_have_a_row_for_each_interval_direction_and_class(self, tmp_path: Path) -> None:
        cars = named(frames(GOES_EAST), "car")
        truck = named(numbered(frames(TURNS_BACK), 2), "truck")
        counted = {"v": counts(joined(cars, truck), WEST)}
        self.write(counts_content, tmp_path / "c.totals.csv", counted, 5)
        assert (tmp_path / "c.totals.csv").read_text().splitlines() == [
            "start,end,name,direction,class,count,observed,part,per_hour",
            "0.0,5.0,west,left,car,1,5.0,False,", "0.0,5.0,west,left,truck,1,5.0,False,",
            "0.0,5.0,west,right,car,0,5.0,False,", "0.0,5.0,west,right,truck,0,5.0,False,",
            "5.0,10.0,west,left,car,0,5.0,False,", "5.0,10.0,west,left,truck,0,5.0,False,",
            "5.0,10.0,west,right,car,0,5.0,False,", "5.0,10.0,west,right,truck,1,5.0,False,",
            "10.0,15.0,west,left,car,0,0,True,", "10.0,15.0,west,left,truck,0,0,True,",
            "10.0,15.0,west,right,car,0,0,True,", "10.0,15.0,west,right,truck,0,0,True,",
        ]  # fmt: skip

    def test_zones_have_a_row_for_each_interval(self, tmp_path: Path) -> None:
        counted = {"v": counts(frames(GOES_EAST), WEST, ZONE)}
        self.write(counts_content, tmp_path / "c.zones.csv", counted, 5)
        assert (tmp_path / "c.zones.csv").read_text().splitlines() == [
            "start,end,name,entered,left,mean,max,mean_stay,max_stay,observed,part",
            "0.0,5.0,zone,1,0,0.4,1,,,5.0,False",
            "5.0,10.0,zone,0,1,0.4,1,4.0,4.0,5.0,False",
            "10.0,15.0,zone,0,0,0.0,0,,,0,True",
        ]
