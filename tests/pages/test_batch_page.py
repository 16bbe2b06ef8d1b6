"""The page over the videos of a batch."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from browser import browser
from pages.html import Elements
from vdet.pages.video import NO_STILL, Row, write_index

NASTY = "</script><b>"


def facts(*rows: Row, start: float = 0.0) -> dict[str, Any]:
    numbers = {"seconds": 2.08, "frames": 52, "vehicles": len(rows), "max_at_once": 1}
    named = {"counts": {}, "conditions": [], "review": ""}
    return {"plays": True, "start": start, **numbers, **named, "still": NO_STILL, "rows": rows}


def row(number: int, kind: str | None, first: float, **more: Any) -> Row:
    unknown = dict.fromkeys(("clock", "speed", "distance", "lane"))
    empty = dict.fromkeys(("lines", "motion", "side", "size", "certainty", "picture", "clip"), "")
    known = {"id": number, "class_name": kind, "first": first, "seconds": 1.5}
    return {**unknown, **empty, **known, **more}


VIDEOS = {
    "a": facts(
        row(
            *(1, "car", 0.0),
            clock="2026-05-01T07:00:02+02:00",
            lines="north → south",
            speed=51.5,
            motion="drove",
            distance=18.2,
            lane=-1,
            side="left",
            size="near",
            certainty="sure",
            clip="../a.clips/clip-1.mp4",
        ),
        row(2, None, 1.0, picture="../a.crops/vehicle-0002.jpg"),
    ),
    "day/b #1": facts(row(1, NASTY, 3.5), row(2, "car", 2.0), start=0.5),
}


def index(folder: Path, videos: dict[str, dict[str, Any]], **failed: str) -> str:
    """Write the page over these videos, and return it."""
    summaries = {
        name: {"page": f"{Path(name).name}.page/page.html", **found}
        for name, found in videos.items()
    }
    errors = {name: {"error": error} for name, error in failed.items()}
    write_index(summaries | errors, folder / "index.html")
    return (folder / "index.html").read_text(encoding="utf-8")


def test_it_links_each_page_and_adds_up(tmp_path: Path) -> None:
    made = Elements(index(tmp_path, VIDEOS))
    links = {link["href"] for link in made.all("a")}
    assert links == {"a.page/page.html", "day/b%20%231.page/page.html"}
    for words in ("4vehicles", "2 videos", "0:04", "104frames"):
        assert words in made.text
    assert all(
        address.startswith("data:image/jpeg;") or address in links for address in made.addresses()
    )


def test_columns_in_which_nothing_is_known_are_left_out(tmp_path: Path) -> None:
    html = index(tmp_path, {"a": facts(row(1, "car", 0.0))})
    (table,) = re.findall('id="vehicles">(.*?)</script>', html)
    columns = {"class", "id", "first", "seconds"}
    assert set(json.loads(table)) == {"names", "pages", "plays", "starts", "counts"} | columns


def test_a_video_that_failed_is_named_with_its_error(tmp_path: Path) -> None:
    made = Elements(index(tmp_path, VIDEOS, c="in/c.mp4: cannot be read"))
    assert "3 videos, 1 failed" in made.text
    assert "Failed or doubtful\n\nc failed: in/c.mp4: cannot be read\n" in made.text


def test_a_narrow_screen_shows_the_first_row_whole_and_breaks_names_at_separators(
    tmp_path: Path,
) -> None:
    clip = {"clip": "../a.clips/clip-1.mp4", "clock": "2026-05-01T07:00:02+02:00", "speed": 51.5}
    index(tmp_path, {"cam_20261127_174000": facts(row(1, "car", 0.0, **clip)), "b": facts()})
    rows = (
        "const row = document.querySelector('#found tbody tr');"
        "return [row.innerText.split(/\\s*\\n/), Math.max(...[row, ...row.querySelectorAll('a')]"
        ".map(item => item.getBoundingClientRect().right)) < innerWidth,"
        " row.getBoundingClientRect().bottom < innerHeight,"
        " document.querySelector('figcaption b').innerHTML]"
    )
    with browser(tmp_path, 400, 900, touch=True) as window:
        window.visit(tmp_path / "index.html")
        values = ["#1", "car", "cam_20261127_174000", "2026-05-01 07:00:02", "clip", "1.5", "52"]
        assert window.run(rows) == [values, True, True, "cam_<wbr>20261127_<wbr>174000"]


def test_back_from_a_page_the_table_is_filtered_as_it_was(tmp_path: Path) -> None:
    acts = """
form.elements.class.value = "car"; // as the browser fills it in, after the scripts have run
dispatchEvent(new PageTransitionEvent("pageshow"));
const classes = [...body.rows].map(row => row.cells[2].textContent);
return [filter.firstElementChild.textContent, classes];
"""
    index(tmp_path, VIDEOS)
    assert after(acts, tmp_path) == ["Filter (1)", ["car", "car"]]


@pytest.mark.parametrize("width", [1300, 400])
def test_failures_and_doubts_are_in_sight(tmp_path: Path, width: int) -> None:
    doubts = "dark from 0:00 to 1:00: of 10 vehicles, 6 are found", "drops from 0:00 to 1:00"
    videos = {f"NO20261127-17{number:02}00-F": facts() for number in range(11)}
    names = list(videos)[3::4]
    videos |= {name: facts() | {"conditions": doubts} for name in names}
    index(tmp_path, videos, **{"NO20261127-180000-F": "in/NO20261127-180000-F.mp4: is not a video"})
    with browser(tmp_path, width, 800, touch=width < 500) as window:
        window.visit(tmp_path / "index.html")
        texts, bottom = window.run(
            "const items = [...document.querySelectorAll('main > :first-child li')];"
            "return [items.map(item => item.textContent),"
            " items.at(-1).getBoundingClientRect().bottom / innerHeight];"
        )
        assert texts == [
            "NO20261127-180000-F failed: in/NO20261127-180000-F.mp4: is not a video",
            *(f"{name} {'; '.join(doubts)}" for name in names),
        ]
        assert bottom < 1


def test_of_no_video_it_says_so(tmp_path: Path) -> None:
    assert "No video was processed." in Elements(index(tmp_path, {})).text


def after(acts: str, folder: Path) -> Any:
    """Return what acts in the page over the videos return."""
    with browser(folder) as window:
        window.visit(folder / "index.html")
        return window.run(acts)


def test_its_table_is_filtered_and_sorted(tmp_path: Path) -> None:
    acts = """
const shownRows = () => [...document.querySelectorAll("#found tbody tr")].map(
  row => [...row.children].map(cell => cell.querySelector("a")?.href.split("/").pop()
    ?? cell.textContent));
const change = (name, value) => {
  form.elements[name].value = value;
  form.dispatchEvent(new Event("input"));
};
const seen = { all: shownRows() };
[...document.querySelectorAll("#found th button")].find(b => b.textContent === "class").click();
seen.sorted = shownRows().map(row => row[2]);
change("class", "car");
seen.cars = shownRows().map(row => row[3]);
change("video", "B #");
seen.both = shownRows().map(row => row[3]);
form.reset();
change("from", "2026-05-01T07:00");
seen.since = shownRows().map(row => row[4]);
seen.range = document.getElementById("range").textContent;
form.reset();
change("lane", "-1");
seen.left = shownRows().map(row => row[1]);
change("distance-max", "18");
seen.near = shownRows();
form.reset();
change("first-min", "0:01");
change("first-max", "0:02");
seen.second = shownRows().map(row => row[4]);
form.reset();
change("side", "left");
change("size", "near");
change("certainty", "sure");
seen.beside = shownRows().map(row => row[5]);
return seen;
"""
    index(tmp_path, VIDEOS)
    assert after(acts, tmp_path) == {
        "all": [
            ["", "#1", "car", "a", "page.html#t=0.000", "clip-1.mp4", "1.5", "52", "north → south",
             "-1", "18", "drove", "left", "near"],
            ["", "#2", "vehicle", "a", "page.html#t=1.000", "", "1.5", *[""] * 7],
            ["", "#1", NASTY, "day/b #1", "page.html#t=3.000", "", "1.5", *[""] * 7],
            ["", "#2", "car", "day/b #1", "page.html#t=1.500", "", "1.5", *[""] * 7],
        ],
        "sorted": [NASTY, "car", "car", "vehicle"],
        "cars": ["a", "day/b #1"],
        "both": ["day/b #1"],
        "since": ["page.html#t=0.000"],
        "range": "1–1 of 1 (4 without filters); 3 without such a value",
        "left": ["#1"],
        "near": [],
        "second": ["page.html#t=1.500", "page.html#t=1.000"],
        "beside": ["clip-1.mp4"],
    }  # fmt: skip


def test_of_videos_without_vehicles_the_table_says_so(tmp_path: Path) -> None:
    index(tmp_path, {"a": facts()})
    acts = "return document.getElementById('range').textContent"
    assert after(acts, tmp_path) == "No vehicle matches the filters."


def test_it_is_printed_with_all_that_passes_the_filters_and_says_which(tmp_path: Path) -> None:
    acts = """
const state = () => [body.children.length, document.getElementById("range").textContent,
  [...form.querySelectorAll("label:not(.unprinted)")].map(label => label.textContent.trim())];
document.getElementById("next").click();
const seen = { screen: state() };
form.elements["seconds-max"].value = "2";
form.dispatchEvent(new Event("input"));
dispatchEvent(new Event("beforeprint"));
seen.paper = state();
dispatchEvent(new Event("afterprint"));
seen.after = state();
return seen;
"""
    rows = [row(number, "car", number) for number in range(2500)]
    long = [{**item, "seconds": 3.0} for item in rows[:300]]
    index(tmp_path, {"a": facts(*rows, *long)})
    assert after(acts, tmp_path) == {
        "screen": [100, "101–200 of 2,800", []],
        "paper": [2000, "1–2,000 of 2,500 (2,800 without filters)", ["Seconds  –"]],
        "after": [100, "1–100 of 2,500 (2,800 without filters)", ["Seconds  –"]],
    }
