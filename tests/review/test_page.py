"""The page of reviews in a real browser: check, correct, save, reload."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from zlib import crc32

import pytest
import yaml

from browser import ENTER, Browser, browser, downloaded
from conftest import Run
from review_roads import Car, draw_road, write_review

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
        "const column = document.querySelector(`[data-at='0 ${item.minute} ${number}']`);"
        "const box = column.getBoundingClientRect();"
        "let y = (seconds % 60) / item.seconds - number; if (item.is_upward) y = 1 - y;"
        "column.dispatchEvent(new MouseEvent('click', { bubbles: true,"
        " clientX: box.left + position * box.width, clientY: box.top + y * box.height }));",
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


def test_the_saved_file_corrects_the_counts_and_is_their_truth(
    window: Browser, run: Run, tmp_path: Path
) -> None:
    click_at(window, 8, 0.29)  # of a minute that is not checked yet
    window.type("s")
    path = downloaded(window.folder, "corrections.yaml")
    [missed] = yaml.safe_load(path.read_text("utf-8"))["events"]
    assert missed["error"] == ["missed"]
    path.unlink()
    window.type(TAB, "x", ENTER, "s")
    review, plain = downloaded(window.folder, "corrections.yaml"), tmp_path / "plain.csv"
    count = ("count", tmp_path / "tracks.txt", "-c", tmp_path / "gate.yaml", "--rate", "10")
    run(*count, "--counts", plain, code=0)
    result = run(*count, "--corrections", review, code=0)
    assert [line.split()[1:4] for line in result.out.splitlines()[1:3]] == [
        ["gate", "away", "2"], ["gate", "here", "1"],
    ]  # fmt: skip
    result = run("eval", "counts", plain, review, code=0)
    assert result.out.splitlines()[-1].split()[3:8] == ["2", "2", "1", "1", "0"]


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


def test_marks_lie_on_the_strip_and_the_table_counts_errors(window: Browser) -> None:
    assert window.run("return document.querySelectorAll('.mark').length") == 2
    click_at(window, 8, 0.29)
    window.type(TAB, "x")
    rows = window.run("return totals().filter(row => row[1] === 'all')")
    assert rows == [["gate", "all", 3, 0, 1, 1, 0, 0]]


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
