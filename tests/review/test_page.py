"""The page of reviews in a real browser: check, correct, save, reload."""

import re
import shutil
from base64 import b64decode
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
import pytest
import yaml

from browser import ENTER, Browser, browser, downloaded
from conftest import Run
from review_roads import CAR, GATE, Car, draw_road, read_page, write_review
from vdet.media.images import decode_image

CARS = [Car(3, 80), Car(3.6, 240, goes_up=False), Car(8, 100), Car(64, 80)]
TAB = "\ue004"


@pytest.fixture
def window(tmp_path: Path, run: Run) -> Iterator[Browser]:
    """The page of a minute with three cars, of which the last was missed, and another minute."""
    road = draw_road(tmp_path, CARS, missed=2, seconds=120)
    page = write_review(run, tmp_path, road)
    with browser(tmp_path) as opened:
        opened.open(page)
        yield opened


def click_at(window: Browser, seconds: float, position: float) -> None:
    """Click on the strip at a time of this minute."""
    window.run(
        "const [seconds, position] = arguments;"
        "const item = data.pictures.find(p => p.minute === Math.floor(seconds / 60));"
        "const number = Math.floor((seconds % 60) / item.seconds);"
        "const view = document.querySelector(`[data-at='0 ${item.minute} ${number}'] i`);"
        "const box = view.getBoundingClientRect();"
        "const { x, y } = placeIn(item, number, seconds, position);"
        "view.dispatchEvent(new MouseEvent('click', { bubbles: true,"
        " clientX: box.left + x * box.width, clientY: box.top + y * box.height }));",
        seconds,
        position,
    )


def saved(window: Browser) -> dict[str, Any]:
    window.type("s")
    path = downloaded(window.folder, "corrections.yaml")
    values: dict[str, Any] = yaml.safe_load(path.read_text("utf-8"))
    path.unlink()
    return values


def test_a_minute_without_errors_takes_one_key(window: Browser) -> None:
    window.type(ENTER)
    assert window.text("#minute") == "1:00 to 2:00"
    values = saved(window)
    span = {"line": "gate", "start": 0, "end": 60, "complete": True}
    assert values["checked"] == [span]
    assert [(event["id"], event["direction"]) for event in values["events"]] == [
        (1, "away"), (2, "here"),
    ]  # fmt: skip
    assert not any("error" in event for event in values["events"])
    window.type(ENTER)
    assert saved(window)["checked"] == [{**span, "end": 120}]
    odd = "a\x85\u2028b\n"
    assert yaml.safe_load(window.run("return json(arguments[0])", odd)) == odd


def test_every_error_takes_two_actions(window: Browser) -> None:
    window.type(TAB, "x")  # no vehicle
    window.type(TAB, "3")  # another class
    click_at(window, 8, 0.29)
    window.type("2")
    window.type(ENTER)
    window.type(TAB, "d")  # another direction
    sentence = "Checked 1 of 2 spans: 50.0 % counted, 1 false; bus: 0 of 1 named right."
    assert window.text("#summary p") == sentence
    rows = window.run("return totals().filter(row => row[1] === 'all')")
    assert rows == [["gate", "all", 3, 2, 1, 1, 1, 1]]
    values = saved(window)
    assert values["video"].endswith("/in.mp4")
    assert (values["length"], values["begin"]) == (120, None)
    assert [values[name] for name in ("start", "end", "span")] == [0, 120, 60]
    assert values["size"] == [320, 240]
    gate = {"name": "gate", "start": [20, 120], "end": [300, 120], "left": "away", "right": "here"}
    assert values["lines"] == [gate]
    classes = window.run("return data.classes")
    false, wrong, missed, turned = values["events"]
    assert (false["id"], false["error"]) == (1, ["false"])
    assert (wrong["id"], wrong["error"], wrong["correct"]) == (2, ["class"], [classes[2]])
    assert missed.pop("time") == pytest.approx(8, abs=0.05)
    assert missed == {"line": "gate", "direction": "away", "class": classes[1], "error": ["missed"]}
    assert (turned["id"], turned["error"], turned["correct"]) == (4, ["direction"], ["here"])


def test_the_class_and_the_direction_of_a_mark_may_both_be_wrong(window: Browser) -> None:
    window.type(TAB, "3", "d")
    assert window.run("return document.querySelector('#details img').naturalWidth") == 28
    wrong, neighbour = saved(window)["events"]
    truck = window.run("return data.classes[2]")
    assert (wrong["id"], wrong["error"], wrong["correct"]) == (
        1, ["class", "direction"], [truck, "here"],
    )  # fmt: skip
    assert (neighbour["id"], "error" in neighbour) == (2, False), "of a minute that is not checked"
    window.type("x")
    assert [event.get("error") for event in saved(window)["events"]] == [["false"], None]


def test_undo_and_reload_keep_what_was_checked(window: Browser) -> None:
    window.type(TAB, "x")
    click_at(window, 8, 0.29)
    window.type("z")
    window.type(ENTER)
    window.run("location.reload()")
    window.wait("return document.body.dataset.ready === 'yes'")
    assert window.text("#minute") == "1:00 to 2:00"
    values = saved(window)
    assert [event.get("error") for event in values["events"]] == [["false"], None]
    assert [item["end"] for item in values["checked"]] == [60]


def test_a_sample_is_drawn_and_gives_an_estimate_of_the_true_count(window: Browser) -> None:
    assert window.text("#estimate") == "Draw a sample for an estimate of the true count."
    window.run("document.getElementById('draw').click()")  # 10 minutes, of which there are 2
    assert window.text("#estimate") == "The estimate needs three checked spans of the sample."
    first, second = window.run("return state.sample.spans")
    assert sorted((first, second)) == [0, 1]
    window.run("current = 0; refresh()")
    click_at(window, 8, 0.29)
    window.run(f"current = {first}; refresh()")
    window.type(ENTER, ENTER)
    assert window.text("#estimate").startswith(
        "all: 3 counted, 4 corrected, 4 estimated (95 %: 4 to 4)"
    )
    values = saved(window)
    assert values["sample"] == {"seed": crc32(b"in.mp4"), "spans": [first, second]}


OVERLAPS = """
    const boxes = name => [...document.querySelectorAll(name)].map(e => e.getBoundingClientRect());
    const meet = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 &&
      Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1;
    const marks = boxes(".mark"), views = boxes(".column > i");
    const isOver = (mark, i) => marks.some((other, j) => j > i && meet(mark, other));
    return { marks: marks.length, "over marks": marks.filter(isOver).length,
      "over vehicles": marks.filter(mark => views.some(view => meet(mark, view))).length,
      side: Math.min(...views.map(view => view[arguments[0]])), fits:
      document.documentElement.scrollWidth <= document.documentElement.clientWidth };
"""


@pytest.mark.parametrize("width", [1280, 1920])
@pytest.mark.parametrize("way", ["up", "right"])
def test_marks_cover_neither_vehicles_nor_one_another(
    tmp_path: Path, run: Run, way: str, width: int
) -> None:
    """Thirty cars in a minute, half of them within three seconds."""
    times = [3 + 0.2 * n for n in range(15)] + [8 + 3 * n for n in range(15)]
    cars = [Car(time, 60 + 80 * (n % 3), goes_up=False) for n, time in enumerate(times)]
    upright = GATE.replace("[20, 120], end: [300, 120]", "[160, 239], end: [160, 1]")
    settings, is_side_on = (upright if way == "right" else GATE), way == "right"
    road = draw_road(tmp_path, cars, seconds=60, settings=settings, is_side_on=is_side_on)
    page = write_review(run, tmp_path, road)
    with browser(tmp_path, width, 1000) as window:
        window.open(page)
        assert window.run("return data.pictures.map(picture => picture.way)") == [way]
        found = window.run(OVERLAPS, "height" if is_side_on else "width")
        assert 400 <= found.pop("side") <= 800
        assert found == {"marks": 30, "over marks": 0, "over vehicles": 0, "fits": True}
        places = window.run(
            "const [item] = data.pictures; return data.marks.map(({ seconds, position }) => {"
            " const number = Math.floor(seconds / item.seconds);"
            " return { number, ...placeIn(item, number, seconds, position) }; });"
        )
    picture = read_page(page).pictures[0].astype(int)
    columns = np.split(picture, picture.shape[0] // 238 if is_side_on else 1)
    for place in places if is_side_on else ():
        column = columns[place["number"]]
        height, across = column.shape[:2]
        above = column[round(place["y"] * height) - CAR // 2, round(place["x"] * across)]
        assert above[2] > above[1] + 80, "it stands upright above its foot"


def test_a_doubtful_mark_shows_its_frame_with_box_line_and_path(tmp_path: Path, run: Run) -> None:
    road = draw_road(tmp_path, CARS[:2], seconds=12)
    unsure = (
        line.replace(",0.9,", ",0.5,") if line.split(",")[1] == "1" else line
        for line in road.tracks.read_text().splitlines()
    )
    road.tracks.write_text("\n".join(unsure))
    page = write_review(run, tmp_path, road, "--set", "input.begin=2026-05-01T07:00:00")
    with browser(tmp_path) as window:
        window.open(page)
        assert window.text("#minute") == "7:00:00 to 7:00:12"
        times = window.run("return [...document.querySelectorAll('small')].map(e => e.innerText)")
        assert times[:3] == ["7:00:00", "7:00:10", "7:00:10"], "at the ends of columns"
        shown = "return [...document.querySelectorAll('#details .moment')].map(e => e.naturalWidth)"
        window.type(TAB)
        assert window.run(shown) == [320]
        window.type(TAB)
        assert window.run(shown) == []
        assert window.run("return document.getElementById('scene').naturalWidth") == 320
    [data] = re.findall(r'id="moment-0-1-[^"]*">([^<]*)<', page.read_text("utf-8"))
    image = decode_image(b64decode(data))
    assert image is not None
    blue, green, red = np.moveaxis(image[:, 40:120].astype(int), 2, 0)
    is_green, is_red = green - np.maximum(red, blue) > 20, red - np.maximum(green, blue) > 60
    assert is_green[130:200].any(), "its path"
    assert is_green[92:116, 24:32].any(), "the left side of its box"
    assert is_red[90:120].any()


def test_a_column_repeats_the_end_of_the_one_before(window: Browser) -> None:
    """The car at 3 s is drawn at 3 s of a column; half a second is repeated at its start."""
    page = read_page(window.folder / "review/review.html")
    [layout, _] = page.data["pictures"]
    columns = np.split(page.pictures[0].astype(int), layout["columns"], axis=1)
    rows = round(layout["lead"] * layout["rows"] / (layout["seconds"] + layout["lead"]))
    assert layout["lead"] == 0.5
    for before, column in pairwise(columns):
        assert np.abs(before[-rows:] - column[:rows]).mean() < 8


def test_a_review_is_opened_again_corrected_saved_and_counted(tmp_path: Path, run: Run) -> None:
    """The page and the command say the same each time, with its interval."""
    road = draw_road(tmp_path, [*CARS, Car(130, 80), Car(190, 80)], missed=2, seconds=240)
    page, fixes = write_review(run, tmp_path, road), tmp_path / "corrections.yaml"
    count = ("count", road.tracks, "-c", road.settings, "--rate", "10", "--corrections", fixes)

    def said(window: Browser) -> str:
        """Save, count, and return what both say of the true number."""
        shown = window.text("#estimate p").removeprefix("all: ").partition(";")[0]
        window.type("s")
        downloaded(tmp_path, fixes.name)
        assert f"at checked lines {shown}\n" in run(*count, code=0).out
        return shown

    with browser(tmp_path) as window:
        window.open(page)
        window.run("get('count').value = 3; draw(); current = 0; refresh()")
        click_at(window, 8, 0.29)
        window.run("[current] = planned(); refresh()")
        window.type(ENTER, ENTER, ENTER)
        first = said(window)
        assert first.startswith("5 counted, 6 corrected, ")
        again = tmp_path / "again"
        opening = ("--tracks-from", road.tracks, "-c", road.settings, "--corrections", fixes)
        run("review", road.video, *opening, "-o", again, code=0)
        fixes.unlink()
        window.open(again / "review.html")
        assert said(window) == first
        fixes.unlink()
        window.run("current = 0; refresh()")
        window.type(TAB, "x")
        assert said(window).startswith("5 counted, 5 corrected, ")
        fixes.unlink()
        window.run("data.limit = 100")
        window.type("s")
        assert window.text("#hint").startswith("Not saved: the file would have more than 100 bytes")
    assert not fixes.exists()


def test_videos_of_one_name_and_other_tracks_of_a_video_share_nothing(
    tmp_path: Path, run: Run
) -> None:
    keys = set()
    for name, missed in (("a", None), ("b", None), ("b", 0)):
        folder = tmp_path / name
        folder.mkdir(exist_ok=True)
        page = write_review(run, folder, draw_road(folder, [Car(2, 80)], missed=missed, seconds=4))
        keys.add(read_page(page).data["key"])
        shutil.rmtree(page.parent)
    assert len(keys) == 3
