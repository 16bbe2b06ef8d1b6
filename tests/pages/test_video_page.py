"""The page of a video."""

import re
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import pytest

from browser import browser
from clips import write_clip
from pages.html import Elements
from run.red_runs import video_info
from traffic.passing import HEIGHT, WIDTH, frame, passing, summarize, track
from vdet.boxes import Box
from vdet.config.scene import TrafficSettings
from vdet.config.schema import Settings, SurveySettings
from vdet.findings import Finding
from vdet.pages.render import jpeg_uri, link_to
from vdet.pages.video import Player, VideoPage
from vdet.track.track import FrameTracks
from vdet.traffic.clock import Clock
from vdet.traffic.counts import Counts, Event
from vdet.traffic.records import VehicleRecord
from vdet.traffic.survey import Survey

NASTY = "<img src=x onerror=alert(1)>&lt;\"'#?%41 javascript:.mp4"
STILL = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)
FOLDER = Path("found/a.page")
VIDEO = Player("a.mp4", "../a.mp4", is_drawn=True, start=0.0)
BOX = Box.sized(5, 5, 30, 30)
TRUCK = replace(track(2, Box.sized(5, 5, 30.123456, 29.9)), class_name="truck")


def records(*frames: FrameTracks) -> Sequence[VehicleRecord]:
    return summarize(frames, WIDTH)


EVERY_SECOND = Settings(traffic=TrafficSettings(interval="1s"))
TWO = records(*passing(50), frame(50, TRUCK), frame(51, TRUCK))


def page(
    *, source: Path = Path("clips/a.mp4"), player: Player | None = VIDEO, end: float = 2.08
) -> VideoPage:
    return VideoPage(
        video=replace(video_info(WIDTH, HEIGHT), path=source), frames=52,
        spans=[(0.0, end - float(1 / video_info(WIDTH, HEIGHT).rate))],
        records=TWO, thumbnails={1: jpeg_uri(STILL)}, poster=STILL, still=STILL, player=player,
        settings=Settings(),
    )  # fmt: skip


def counted(*events: tuple[Any, ...]) -> Counts:
    """Return counts of events: name, direction, time, vehicle and speed."""
    made = [
        Event(time, 25 * time, name, way, vehicle, vehicle, None, 0.9, speed=speed)
        for number, event in enumerate(events, start=10)
        for name, way, time, *more in [event]
        for vehicle, speed in [(*more, *(number, None)[len(more) :])]
    ]
    return Counts(tuple(made), tuple(dict.fromkeys((e.name, e.direction) for e in made)), ())


def survey(counts: Counts) -> Survey:
    return Survey({"a.mp4": counts}, Settings())


def player_of(name: str) -> Player:
    return Player(name, link_to(Path("found") / name, FOLDER), is_drawn=True, start=0.0)


def seen(made: VideoPage) -> Elements:
    """Return the elements of a page, without the comments on its settings."""
    return Elements(re.sub(r"(?m)^ *# .*$", "", made.html()))


IN_OUT = counted(("north", "in", 1), ("north", "in", 2), ("north", "out", 3))
CLASSES = zip(IN_OUT.events, ("car", "truck", None), strict=True)
BY_CLASS = replace(IN_OUT, events=tuple(replace(e, class_name=name) for e, name in CLASSES))
FLOWS = counted(("north", "in", 1, 1), ("south", "out", 2, 1), ("north", "in", 1, 2))
SPEEDS = counted(("north", "in", 1, 1, 36.0), ("north", "in", 2, 2, 40.0))
BY_NAME = counted(*(("north", "in", at) for at in (1, 2, 3)), (NASTY, "in", 1))
SOURCE = Player("b.mp4", "../b.mp4", is_drawn=False, start=0.0)
DARK = Finding("dark", "it <was> dark", ((0.5, 1.5),), "warning", 0.3)
MOVES = replace(DARK, code="camera-moves")
STOOD = [replace(record, motion="standing") for record in TWO]
BUS = replace(TWO[0], class_name="bus")
SHOWN: dict[str, tuple[dict[str, Any], str, str]] = {
    "what was found": (
        {},
        "Vehicles in a.mp4 | 52 frames | 320 × 240 pixels | 2 vehicles | 1 truck | crf: 25 | Paths",
        "clips/ | Flows | Findings",
    ),
    "the video of the run": (
        {}, "maximum at once | a.mp4, with the vehicles drawn.", "No video to show",
    ),
    "the source as its video": (
        {"player": SOURCE}, "b.mp4, the source; this run did not write a video", "drawn.",
    ),
    "no video": ({"player": None}, "No video to show", "../a.mp4 | clips/"),
    "no vehicles": (
        {"records": (), "thumbnails": {}, "poster": None, "still": None},
        "No vehicle was shown. | 0 vehicles", "1 truck",
    ),
    "gaps of the video": ({"spans": [(0, 1), (2, 2)]}, "No frames from 0:01 to 0:02", ""),
    "counts by interval": (
        {"survey": survey(BY_NAME), "settings": EVERY_SECOND},
        f"At lines and zones | north: in: 3 | {NASTY}: in: 1", "",
    ),
    "no counts by interval without one": ({"survey": survey(BY_NAME)}, "", "At lines and zones"),
    "vehicles by interval and class, if they drove": (
        {"records": [BUS, STOOD[1]], "settings": EVERY_SECOND}, "First seen | bus: 1", "truck: 1",
    ),
    "a row for each direction with its classes": (
        {"survey": survey(BY_CLASS)},
        "direction all vehicles car truck vehicle heavy, % north in 2 1 1 0 50 north out 1 0 0 1 0",
        "",
    ),
    "a row for each flow": (
        {"survey": survey(FLOWS)}, "from to all vehicles north south 1 north (none) 1", "",
    ),
    "speeds": ({"survey": survey(SPEEDS)}, "north in 2 38 39", ""),
    "doubts with their times": ({"findings": (DARK,)}, "Findings | it <was> dark", ""),
    "no paths of a moving camera": ({"findings": (MOVES,)}, "Findings", "Paths"),
    "vehicles that stood apart": (
        {"records": [replace(TWO[0], motion="drove"), STOOD[1]]}, "1 vehicle | 1 standing", "",
    ),
    "no card for vehicles of unknown class": (
        {"records": [replace(TWO[0], class_name="vehicle"), TWO[1]]},
        "2 vehicles 1 truck 1 maximum at once", "",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", SHOWN)
def test_the_page_shows(what: str) -> None:
    changes, there, absent = SHOWN[what]
    made = seen(replace(page(), **changes))
    text = "".join(made.text.split())
    for words in filter(None, there.split(" | ")):
        assert "".join(words.split()) in text, words
    for words in filter(None, absent.split(" | ")):
        assert "".join(words.split()) not in text, words
    assert len(made.all("video")) == (changes.get("player", VIDEO) is not None)


def test_it_loads_nothing_but_the_video_and_its_own_data() -> None:
    for player, expected in ((VIDEO, {"../a.mp4"}), (None, set[str]())):
        made = seen(page(player=player))
        own = [a.partition("#")[0] for a in made.addresses() if not a.startswith("data:")]
        assert set(own) == expected
    (video,) = seen(page()).all("video")
    assert (video["poster"] or "").startswith("data:image/jpeg;base64,"), "until it plays"


def test_a_flow_has_an_arrow() -> None:
    images = seen(replace(page(), survey=survey(FLOWS))).all("img")
    assert any("an arrow for each flow" in (item["alt"] or "") for item in images)


def test_intervals_begin_at_round_times_of_the_clock_as_in_tables() -> None:
    counts = counted(*(("north", "in", at) for at in (60, 360, 840)))
    begin = datetime.fromisoformat("2026-05-01 07:10+02:00")
    clock = Clock(begin, "as given", begin.tzinfo)
    quarters = Settings(traffic=TrafficSettings(interval="15min"))
    made = seen(replace(page(end=900), survey=survey(counts), settings=quarters, clock=clock))
    tips = re.findall(r"07:..: . north: in", made.text)
    assert tips == ["07:00: 1 north: in", "07:15: 2 north: in"]
    rows = replace(counts, spans=((0, 899.96),), clock=clock).table(900)
    assert [(f"{row.start:%H:%M}", row.count) for row in rows] == [("07:00", 1), ("07:15", 2)]


def test_a_vehicle_that_was_lost_has_a_gap_in_its_bar() -> None:
    states = ("detected", "detected", "predicted", "predicted", "interpolated", "detected")
    frames = [frame(n, track(1, BOX, state=state)) for n, state in enumerate(states)]
    made = seen(replace(page(end=0.2), records=records(*frames)))
    spans = [(item["x"], item["width"]) for item in made.all("svg", **{"class": "span"})]
    assert spans == [("0.0%", "20.0%"), ("80.0%", "20.0%")]


def test_every_name_is_escaped() -> None:
    bus = replace(track(1, Box.sized(5, 5, 30, 30)), class_name=NASTY)
    made = replace(
        page(source=Path("clips") / NASTY, player=player_of(NASTY)),
        records=records(frame(0, bus), frame(1, bus)),
        settings=Settings(survey=SurveySettings(site=NASTY)),
        thumbnails={1: jpeg_uri(STILL)},
    )
    plain, nasty = seen(page()), seen(made)
    assert {tag for tag, _ in nasty.seen} == {tag for tag, _ in plain.seen}
    assert not any("onerror" in attributes for _, attributes in nasty.seen)
    assert nasty.all("img", src="x") == []
    assert nasty.text.count(NASTY) >= 6
    (video,) = nasty.all("video")
    assert unquote(video["src"] or "") == f"../{NASTY}"
    assert re.fullmatch(r"[\w./%~-]+", video["src"] or ""), "nothing in it has a meaning"


@pytest.mark.parametrize("name", ["a\x1b[31m\n\u202egpj.mp4", "clip\udcff.mp4"])
def test_a_name_that_is_no_plain_text_can_be_shown_and_reached(name: str) -> None:
    made = page(source=Path(name), player=player_of(name))
    html = made.html()
    assert not {"\x1b", "\u202e", "\udcff"} & set(html)
    html.encode("utf-8")


def test_the_summary_has_the_counts_and_a_row_for_each_vehicle() -> None:
    counts = counted(("north", "in", 1, 1), ("south", "in", 2, 1), *[("</script><b>", "in", 1)] * 8)
    clock = Clock(datetime(2026, 5, 1, 7, tzinfo=UTC), "as given", UTC)
    known = {1: "../a.crops/vehicle-0001.jpg"}
    summary = replace(page(), survey=survey(counts), clock=clock, pictures=known).summary
    assert [summary[name] for name in ("frames", "vehicles", "max_at_once")] == [52, 2, 1]
    assert summary["counts"] == {"north: in": 1, "south: in": 1, "</script><b>: in": 8}
    nothing = dict.fromkeys(("speed", "distance", "lane")) | {"motion": "", "clip": ""}
    assert summary["rows"] == [
        nothing | {
            "id": 1, "class_name": None, "first": 0.0, "seconds": 2.0, "side": "left",
            "clock": "2026-05-01T07:00:00+00:00", "lines": "north → south", "size": "near",
            "certainty": "sure", "picture": "../a.crops/vehicle-0001.jpg",
        },
        nothing | {
            "id": 2, "class_name": "truck", "first": 2.0, "seconds": 0.1, "side": "left",
            "clock": "2026-05-01T07:00:02+00:00", "lines": "", "size": "far", "picture": "",
            "certainty": "unsure",
        },
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("player", "is_there", "links"),
    [
        (VIDEO, True, ["#t=0.000", "#t=2.000"]),
        (VIDEO, False, ["clip-1.mp4", None]),
        (None, False, ["clip-1.mp4", None]),
    ],
)
def test_a_time_seeks_the_player_or_opens_the_clip(
    tmp_path: Path, player: Player | None, is_there: bool, links: list[str | None]
) -> None:
    path = tmp_path / "a.page" / "page.html"
    path.parent.mkdir()
    made = replace(page(player=player), clips={1: "../a.clips/clip-1.mp4"})
    path.write_text(made.html(), "utf-8")
    if is_there:
        write_clip(tmp_path / "a.mp4")
    reads = """return [...document.querySelectorAll("#found tbody tr")].map(row => [
      row.querySelector("img") !== null,
      row.cells[3].querySelector("a")?.getAttribute("href").split("/").pop() ?? null,
      row.innerText.trim()]);"""
    with browser(tmp_path) as window:
        window.visit(path)
        if player and not is_there:
            window.wait("return !document.getElementById('unplayable').hidden")
        assert window.run(reads) == [
            [True, links[0], "#1\tvehicle\t0:00:00\tclip\t2.0\tleft\tnear"],
            [False, links[1], "#2\ttruck\t0:00:02\t\t0.1\tleft\tfar"],
        ]


def test_a_narrow_browser_needs_no_sideways_scrolling(tmp_path: Path) -> None:
    (tmp_path / "page.html").write_text(page().html(), "utf-8")
    with browser(tmp_path, 390, 844, touch=True) as window:
        window.visit(tmp_path / "page.html")
        assert window.run("return document.documentElement.scrollWidth") == 390
