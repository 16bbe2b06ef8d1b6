"""The workbook of a survey: every sheet, as a spreadsheet reads it."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from textwrap import wrap
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
import openpyxl
import pytest

from vdet.boxes import Image
from vdet.config.schema import Settings
from vdet.findings import Finding
from vdet.pages.traffic import page_table
from vdet.traffic.clock import Clock
from vdet.traffic.counts import Corrected, Correction, Counts, Estimate, Event, VehicleGroup
from vdet.traffic.output import Sheet, SheetTable, write_workbook
from vdet.traffic.survey import HEAVY_NAMED, Survey, movement
from vdet.version import __version__

LINES = {"north": "N", "east": "E", "south": "S"}
CORNERS = (0.2, 0.2), (0.8, 0.2), (0.8, 0.8), (0.2, 0.8)
"""Of a junction, clockwise: the lines lie between them."""
FORMULA = "=HYPERLINK('http://x')"
BEGIN = datetime.fromisoformat("2026-05-01 07:00+02:00")


def settings(**traffic: Any) -> Settings:
    lines = [
        {"name": name, "approach": arm, "start": start, "end": end, "left": "out", "right": "in"}
        for (name, arm), start, end in zip(LINES.items(), CORNERS, CORNERS[1:], strict=False)
    ]
    survey = {"site": FORMULA, "surveyor": "A. Smith", "weather": "dry"}
    values = {"lines": lines, "interval": "30min", "pcu": {"lorry": 2.5}} | traffic
    return Settings.model_validate({"traffic": values, "survey": survey})


def event(
    time: float, name: str, direction: str, vehicle: int, kind: str | None, **values: Any
) -> Event:
    return Event(time, round(25 * time), name, direction, vehicle, vehicle, kind, 0.9, **values)


def counts(begin: datetime, seconds: float, *events: Event, **values: Any) -> Counts:
    directions = [(name, way) for name in LINES for way in ("in", "out")]
    zone = [("box", way) for way in ("enter", "exit")]
    return Counts(
        events=events,
        directions=(*directions, *zone),
        zones=("box",),
        outside_flows=("box",),
        classes=("car", "truck"),
        spans=((0.0, seconds),),
        clock=Clock(begin, "from its name", begin.tzinfo),
        **values,
    )


def test_times_show_their_offset_where_the_clock_changes(tmp_path: Path) -> None:
    zone = ZoneInfo("Europe/Berlin")
    night = counts(datetime(2026, 10, 25, 0, 10, tzinfo=UTC), 4500)
    assert night.clock
    changing = {"night": replace(night, clock=replace(night.clock, zone=zone))}
    for number, (videos, form) in enumerate(((changing, " +0200"), (morning(), ""))):
        write_workbook(tmp_path / f"{number}.xlsx", Survey(videos, settings()).sheets())
        sheet = openpyxl.load_workbook(tmp_path / f"{number}.xlsx")["Intervals"]
        assert sheet["A2"].number_format == "yyyy-mm-dd hh:mm:ss" + (f'"{form}"' if form else "")
    text = page_table(Survey(changing, settings()).files())[1][0]
    assert text[1:3] == ["2026-10-25 02:10:00 +0200", "2026-10-25 02:25:00 +0100"]


def morning() -> dict[str, Counts]:
    """An hour and ten minutes in two files: three vehicles cross the junction, one gets lost."""
    bus, north = (
        Estimate(group, *numbers, minutes_to_precision=9)
        for group, numbers in (
            (VehicleGroup(class_name="bus"), (0, 1, 1.2, 0.9, 2.7)),
            (VehicleGroup("north", "in"), (1, 2, 2.2, 1.8, 3.4)),
        )
    )
    counted = (event(60, "north", "in", 1, "bus"), event(70, "south", "out", 1, "bus"))
    added = event(1000, "north", "in", 2, "truck")
    hour = counts(
        BEGIN,
        3599.96,
        event(60, "north", "in", 1, "car", speed=41.5),
        event(62, "box", "enter", 1, "car"),
        event(66, "box", "exit", 1, "car", seconds=4.0),
        event(70, "south", "out", 1, "car"),
        event(1000, "north", "in", 2, "truck"),
        event(1010, "east", "out", 2, "truck"),
        event(3599, "south", "in", 3, "car"),
        findings=(Finding("line", "east: this line is shorter than a vehicle; make it longer"),),
        corrected=Corrected(
            counted=counted,
            corrections=(
                Correction(counted[0], event(60, "north", "in", 1, "car"), "Ann", BEGIN),
                Correction(None, added, "Ann", BEGIN),
                Correction(counted[1], None),
            ),
            files=("fixes.yaml",),
            names=("north",),
            checked=((0.0, 600.0), (1500.0, 2100.0)),
            observed=3600.0,
            estimates=(bus, north),
        ),
    )
    rest = counts(
        BEGIN + timedelta(hours=1),
        600,
        event(5, "north", "out", 3, "car"),
        event(300, "east", "in", 4, "tractor"),
        findings=(Finding("dark", "the image is dark"),),
    )
    return {"07.jsonl": hour, "08.jsonl": rest}


def written(path: Path, survey: Survey, picture: Image | None = None) -> Path:
    write_workbook(path, survey.sheets(picture))
    return path


def lines_of(path: Path) -> dict[str, list[str]]:
    """Return the cells of each sheet as text, a line for each row."""
    book = openpyxl.load_workbook(path)
    return {sheet.title: [" ".join(map(text_of, row)).rstrip() for row in sheet] for sheet in book}


def text_of(cell: Any) -> str:
    assert cell.data_type in "nsd", "there are no formulas"
    if isinstance(cell.value, datetime):
        assert cell.number_format == "yyyy-mm-dd hh:mm:ss"
        return f"{cell.value:%H:%M:%S}"
    return {None: "-", "": "-"}.get(cell.value, str(cell.value)).replace(" ", "_")


@pytest.fixture
def book(tmp_path: Path) -> Path:
    picture = np.full((90, 160, 3), 99, np.uint8)
    return written(tmp_path / "c.xlsx", Survey(morning(), settings()), picture)


def table(text: str) -> list[str]:
    """Return the lines of a table; an indented line continues the one before."""
    text = text.replace("\n            ", " ")
    return [" ".join(line.split()) for line in text.strip().splitlines()]


def test_the_summary_says_what_was_counted_when_and_how_right(book: Path) -> None:
    empty = " -" * 13
    line = "east: this line is shorter than a vehicle; make it longer [line]"
    texts = (*wrap(f"{line}; the image is dark [dark]", 80), *wrap(HEAVY_NAMED, 80))
    doubt, other, heavy = (text.replace(" ", "_") for text in texts)
    facts = f"""
        {FORMULA} - {empty}
        surveyor A._Smith {empty}
        weather dry {empty}
        files 2_files {empty}
        first_frame 07:00:00 {empty}
        last_frame 08:10:00 {empty}
        observed 1:10:00 {empty}
        time_zone UTC+02:00 {empty}
        clock from_its_name {empty}
        interval 30min {empty}
        checked 20_of_70_minutes {empty}
        conditions {doubt} {empty}
        - {other} {empty}
        heavy_share {heavy} {empty}
        program vdet_{__version__} {empty}
        - - {empty}
        Checks - {empty}
        file corrected_by minutes_checked events_corrected line_or_zone direction class counted
            corrected estimated at_least_(95_%) at_most_(95_%) - - -
        07.jsonl fixes.yaml 20_of_60 3 all   -  bus 0 1 1 1 3 - - -
        07.jsonl fixes.yaml 20_of_60 3 north in -   1 2 2 2 3 - - -
        - - {empty}
        Volumes - {empty}
        line_or_zone direction counted corrected per_hour car truck tractor heavy,_% PCU peak_hour
            vehicles_in_it peak_hour_factor median_km/h 85_%_km/h
        north in        1 2 1.7 1 1 0 50  3.5 07:00:00 2 0.5 41.5 41.5
        north out       1 1 0.9 1 0 0 0   1   -        - - - -
        east  in        1 1 0.9 0 0 1 0   1   -        - - - -
        east  out       0 1 0.9 0 1 0 100 2.5 07:00:00 1 0.25 - -
        south in        0 1 0.9 1 0 0 0   1   07:00:00 1 0.25 - -
        south out       1 1 0.9 1 0 0 0   1   07:00:00 1 0.25 - -
        box   enter     0 1 0.9 1 0 0 0   1   07:00:00 1 0.25 - -
        box   exit      0 1 0.9 1 0 0 0   1   07:00:00 1 0.25 - -
        all_flows -     3 4 3.4 2 1 1 25  5.5 07:00:00 3 0.75 41.5 41.5"""
    assert lines_of(book)["Summary"] == table(facts)


NOTHING = "0 0 0 0 0 - 0"


def test_intervals_and_flows_have_columns_of_classes_and_mark_parts(book: Path) -> None:
    sheets = lines_of(book)
    assert sheets["Checks"] == table("""
        file time_in_the_file line_or_zone direction class error correct reviewer saved
        07.jsonl 0:01:00 north in  bus   class  car Ann 07:00:00
        07.jsonl 0:16:40 north in  truck missed -   Ann 07:00:00
        07.jsonl 0:01:10 south out bus   false  -   -   -""")
    first, second = "07:00:00 07:30:00 1800 - 0", "07:30:00 08:00:00 1800 - 0"
    part = "08:00:00 08:30:00 600 part 0"
    numbers = "all_vehicles per_hour car truck tractor heavy,_% PCU"
    assert sheets["Intervals"] == table(f"""
        start end observed,_s part checked,_s line_or_zone direction {numbers}
        {first[:-1]}900  north in    2 4 1 1 0 50  3.5
        {first[:-1]}900  north out   {NOTHING}
        {first}  east  in    {NOTHING}
        {first}  east  out   1 2 0 1 0 100 2.5
        {first}  south in    {NOTHING}
        {first}  south out   1 2 1 0 0 0   1
        {first}  box   enter 1 2 1 0 0 0   1
        {first}  box   exit  1 2 1 0 0 0   1
        {second[:-1]}300 north in    {NOTHING}
        {second[:-1]}300 north out   {NOTHING}
        {second} east  in    {NOTHING}
        {second} east  out   {NOTHING}
        {second} south in    1 2 1 0 0 0   1
        {second} south out   {NOTHING}
        {second} box   enter {NOTHING}
        {second} box   exit  {NOTHING}
        {part}   north in    {NOTHING}
        {part}   north out   1 6 1 0 0 0   1
        {part}   east  in    1 6 0 0 1 0   1
        {part}   east  out   {NOTHING}
        {part}   south in    {NOTHING}
        {part}   south out   {NOTHING}
        {part}   box   enter {NOTHING}
        {part}   box   exit  {NOTHING}""")
    assert sheets["Flows"] == table(f"""
        start end observed,_s part checked,_s from to {numbers}
        {first[:-1]}900  north south  1 2 1 0 0 0   1
        {first[:-1]}900  north east   1 2 0 1 0 100 2.5
        {first}  south north  {NOTHING}
        {first}  east  (none) {NOTHING}
        {second[:-1]}300 north south  {NOTHING}
        {second[:-1]}300 north east   {NOTHING}
        {second} south north  1 2 1 0 0 0   1
        {second} east  (none) {NOTHING}
        {part}   north south  {NOTHING}
        {part}   north east   {NOTHING}
        {part}   south north  {NOTHING}
        {part}   east  (none) 1 6 0 0 1 0   1""")
    assert sheets["Turning movements"] == table(f"""
        1_of_4_vehicles_without_an_origin_or_a_destination{" -" * 19}
        start end observed,_s part N_left N_through N_right N_U-turn N_all
            E_left E_through E_right E_U-turn E_all S_left S_through S_right S_U-turn S_all
            from_E_to_unknown
        {first[:-2]}  1 1 0 0 2 0 0 0 0 0 0 0 0 0 0 0
        {second[:-2]} 0 0 0 0 0 0 0 0 0 0 0 1 0 0 1 0
        {part[:-2]}   0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 1
        all - - - 1 1 0 0 2 0 0 0 0 0 0 1 0 0 1 1""")


def test_who_leaves_a_junction_without_having_entered_comes_from_unknown(tmp_path: Path) -> None:
    video = counts(BEGIN, 60, event(5, "south", "out", 1, "car"), event(6, "east", "in", 2, "car"))
    sheets = lines_of(written(tmp_path / "c.xlsx", Survey({"a": video}, settings())))
    title, headings, *_, total = sheets["Turning movements"]
    assert title.startswith("2_of_2_vehicles_without")
    assert headings.split()[-2:] == ["from_unknown_to_S", "from_E_to_unknown"]
    assert total == "all - - -" + " 0" * 15 + " 1 1"


def test_zones_vehicles_files_and_notes(book: Path) -> None:
    sheets = lines_of(book)
    assert sheets["Zones"] == table("""
        start end observed,_s part zone entered left mean_inside max_inside mean_stay,_s
            max_stay,_s
        07:00:00 07:30:00 1800 -    box 1 1 0.002 1 4 4
        07:30:00 08:00:00 1800 -    box 0 0 0 0 - -
        08:00:00 08:30:00 600  part box 0 0 0 0 - -""")
    assert sheets["Vehicles"] == table(
        """
        clock time_in_the_file file line_or_zone direction vehicle class score
            seconds_in_the_zone km/h
        07:01:00 0:01:00 07.jsonl north in    1 car     0.9 - 41.5
        07:01:02 0:01:02 07.jsonl box   enter 1 car     0.9 - -
        07:01:06 0:01:06 07.jsonl box   exit  1 car     0.9 4 -
        07:01:10 0:01:10 07.jsonl south out   1 car     0.9 - -
        07:16:40 0:16:40 07.jsonl north in    2 truck   0.9 - -
        07:16:50 0:16:50 07.jsonl east  out   2 truck   0.9 - -
        07:59:59 0:59:59 07.jsonl south in    3 car     0.9 - -
        08:00:05 0:00:05 08.jsonl north out   3 car     0.9 - -
        08:05:00 0:05:00 08.jsonl east  in    4 tractor 0.9 - -""".replace("\n            ", " ")
    )
    assert sheets["Files"] == table("""
        file first_frame last_frame observed,_s after_the_file_before clock events doubts
        07.jsonl 07:00:00 07:59:59 3599.96 -         from_its_name 7 1
        08.jsonl 08:00:00 08:10:00 600     continues from_its_name 2 1""")
    assert sheets["Notes"][:3] == table("""
        file note
        07.jsonl east:_this_line_is_shorter_than_a_vehicle;_make_it_longer_[line]
        08.jsonl the_image_is_dark_[dark]""")
    assert sheets["Notes"][-1] == "- PCU:_truck_2.5;_all_other_classes_1."


def test_sheets_are_ready_to_print(book: Path) -> None:
    summary, *single = openpyxl.load_workbook(book)
    assert [len(summary._images), summary.page_setup.fitToHeight] == [1, None], "on one page"
    for sheet in single:
        top = 2 if sheet.title == "Turning movements" else 1
        printed = (f"$1:${top}", "") if sheet.title != "Vehicles" else (None, "$K$1")
        assert sheet.page_setup.orientation == "landscape"
        assert sheet.sheet_properties.pageSetUpPr.fitToPage
        assert sheet.page_setup.fitToHeight == 0
        assert (sheet.print_title_rows, sheet.print_area.rpartition("!")[2]) == printed
        assert sheet.freeze_panes == f"A{top + 1}"
        assert sheet.auto_filter.ref == sheet.dimensions.replace("A1", f"A{top}")
        height = sheet.row_dimensions[top].height or 15
        for cell in sheet[top]:
            width = int(sheet.column_dimensions[cell.column_letter].width)
            assert height >= 15 * len(wrap(cell.value, width)), "the heading covers no row"
    assert single[0].column_dimensions["A"].width > len("2026-05-01 07:00:00")
    assert single[-1].column_dimensions["B"].width < 90, "long text is wrapped"


def test_without_clocks_and_classes_there_are_times_of_the_video(tmp_path: Path) -> None:
    video = replace(
        morning()["07.jsonl"],
        clock=None,
        classes=("car",),
        events=(event(5.5, "north", "in", 1, None),),
    )
    plain = settings(lines=(), interval=None, pcu={})
    sheets = lines_of(written(tmp_path / "c.xlsx", Survey({"a\udcff": video}, plain)))
    assert "Turning movements" not in sheets
    assert sheets["Intervals"][:2] == table("""
        start end observed,_s part checked,_s line_or_zone direction all_vehicles per_hour
        0:00:00 0:59:59.960000 3599.96 - 1200 north in 1 1""")
    assert sheets["Vehicles"] == table("""
        time_in_the_file file line_or_zone direction vehicle class score
        0:00:05.500000 a\\udcff north in 1 vehicle 0.9""")
    empty = written(
        tmp_path / "empty.xlsx", Survey({"a": replace(video, events=(), corrected=None)}, plain)
    )
    assert [*lines_of(empty)] == ["Summary", "Intervals", "Zones", "Files", "Notes"]
    blank = replace(video, events=(event(5.5, "north", "in", 1, " "),))
    assert lines_of(written(tmp_path / "blank.xlsx", Survey({"a": blank}, plain)))


def test_turns_are_seen_from_the_arm_of_entry() -> None:
    arms = "S", "W", "N", "E", "NE", "SW"
    turns = [movement("N", arm) for arm in arms]  # type: ignore[arg-type]
    assert turns == ["through", "right", "U-turn", "left", "left", "right"]
    assert movement("SW", "NE") == "through"


def test_a_sheet_that_is_full_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vdet.traffic.output._LAST_ROW", 3)
    rows = [[n] for n in range(9)]
    write_workbook(tmp_path / "c.xlsx", [Sheet("many", [SheetTable(["n"], rows)])])
    assert lines_of(tmp_path / "c.xlsx")["many"] == [
        "n", "0", "1", "more_rows_do_not_fit_into_a_sheet;_.csv_has_all",
    ]  # fmt: skip
