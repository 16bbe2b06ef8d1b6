"""The page over the videos of a batch."""

import json
from pathlib import Path
from typing import Any

from pages.html import Elements, needs_chromium, title_in_chromium
from vdet.pages.batch import NO_STILL, VideoFacts, write_index
from vdet.pages.vehicles import VehicleRow

NASTY = "</script><b>"


def facts(*rows: VehicleRow) -> VideoFacts:
    return VideoFacts(
        seconds=2.08, frames=52, vehicles=len(rows), most=1, still=NO_STILL, rows=rows
    )


def row(number: int, kind: str | None, first: float, **more: Any) -> VehicleRow:
    moment = f"{first:.3f}"
    return VehicleRow(id=number, class_name=kind, first=first, moment=moment, seconds=1.5, **more)


VIDEOS = {
    "a": facts(
        row(
            *(1, "car", 0.0),
            clock="2026-05-01T07:00:02+02:00",
            way="north → south",
            speed=51.5,
            motion="drove",
            distance=18.2,
            lane=-1,
        ),
        row(2, None, 1.0, picture="../a.crops/vehicle-0002.jpg"),
    ),
    "day/b #1": facts(row(1, NASTY, 3.5), row(2, "car", 2.0)),
}


def index(folder: Path, videos: dict[str, VideoFacts]) -> str:
    """Write the page over these videos, and return it."""
    pages = [(name, Path(f"{name}.page", "page.html"), found) for name, found in videos.items()]
    write_index(pages, folder / "index.html")
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


def test_its_table_has_every_vehicle(tmp_path: Path) -> None:
    html = index(tmp_path, VIDEOS)
    start = html.index(">", html.index('id="vehicles"')) + 1
    assert json.loads(html[start : html.index("</script>", start)]) == {
        "videos": [
            {"name": "a", "page": "a.page/page.html"},
            {"name": "day/b #1", "page": "day/b%20%231.page/page.html"},
        ],
        "classes": ["", "car", "vehicle", NASTY],
        "ways": ["", "north → south"],
        "video": [0, 0, 1, 1],
        "class": [1, 2, 3, 1],
        "way": [1, 0, 0, 0],
        "states": ["", "drove"],
        "state": [1, 0, 0, 0],
        "id": [1, 2, 1, 2],
        "first": [0.0, 1.0, 3.5, 2.0],
        "moment": ["0.000", "1.000", "3.500", "2.000"],
        "seconds": [1.5] * 4,
        "clock": [1777618802, None, None, None],
        "speed": [51.5, None, None, None],
        "distance": [18.2, None, None, None],
        "lane": [-1, None, None, None],
        "picture": ["", "a.page/../a.crops/vehicle-0002.jpg", "", ""],
    }


def test_of_no_video_it_says_so(tmp_path: Path) -> None:
    assert "No video was processed." in Elements(index(tmp_path, {})).text


@needs_chromium
def test_its_table_is_filtered_and_sorted(tmp_path: Path) -> None:
    acts = """<script>
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
change("class", "1");
seen.cars = shownRows().map(row => row[3]);
change("video", "B #");
seen.both = shownRows().map(row => row[3]);
form.reset();
change("from", "2026-05-01T07:00");
seen.since = shownRows().map(row => row[4]);
form.reset();
change("lane", "-1");
seen.left = shownRows().map(row => row[1]);
change("distance-max", "18");
seen.near = shownRows();
document.title = JSON.stringify(seen);
</script></body>"""
    html = index(tmp_path, VIDEOS).replace("</body>", acts)
    (tmp_path / "acts.html").write_text(html, encoding="utf-8")
    assert json.loads(title_in_chromium(tmp_path / "acts.html")) == {
        "all": [
            ["", "#1", "car", "a", "page.html#t=0.000", "1.5", "52", "north → south", "-1", "18",
             "drove"],
            ["", "#2", "vehicle", "a", "page.html#t=1.000", "1.5", "–", "", "–", "–", ""],
            ["", "#1", NASTY, "day/b #1", "page.html#t=3.500", "1.5", "–", "", "–", "–", ""],
            ["", "#2", "car", "day/b #1", "page.html#t=2.000", "1.5", "–", "", "–", "–", ""],
        ],
        "sorted": [NASTY, "car", "car", "vehicle"],
        "cars": ["a", "day/b #1"],
        "both": ["day/b #1"],
        "since": ["page.html#t=0.000"],
        "left": ["#1"],
        "near": [],
    }  # fmt: skip
