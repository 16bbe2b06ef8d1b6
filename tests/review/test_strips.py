"""Strips: each vehicle leaves one streak, with its mark at the right time and position."""

from pathlib import Path

import pytest

from conftest import Run
from review_roads import GATE, Car, draw_road, read_page, write_review

CARS = [Car(3, 80), Car(5, 240, goes_up=False), Car(8, 100), Car(64, 80), Car(66, 240, False)]


def reviewed(run: Run, folder: Path, missed: int | None = None) -> Path:
    return write_review(run, folder, draw_road(folder, CARS, missed=missed, seconds=70))


def test_each_vehicle_leaves_one_streak_with_its_mark(tmp_path: Path, run: Run) -> None:
    page = read_page(reviewed(run, tmp_path))
    streaks = [streak for minute in (0, 1) for streak in page.streaks(minute)]
    assert len(streaks) == len(CARS) == len(page.data["marks"])
    for car, mark, (seconds, position) in zip(CARS, page.data["marks"], streaks, strict=True):
        assert mark["direction"] == ("away" if car.goes_up else "here")
        assert mark["seconds"] == pytest.approx(car.time, abs=0.05)
        assert mark["position"] == pytest.approx((car.x - 20) / 280, abs=0.01)
        assert position == pytest.approx(mark["position"], abs=0.02)
        # The body passes before the foot of a car that goes away, and after that of one that comes.
        assert seconds == pytest.approx(car.time + (-0.15 if car.goes_up else 0.15), abs=0.1)


def test_a_missed_vehicle_is_a_streak_without_a_mark_and_a_counted_one_has_a_picture(
    tmp_path: Path, run: Run
) -> None:
    page = read_page(reviewed(run, tmp_path, missed=2))
    assert len(page.streaks(0)) == 3
    assert [mark["id"] for mark in page.data["marks"] if mark["seconds"] < 60] == [1, 2]
    assert set(page.crops) == {1, 2, 4, 5}
    for picture in page.crops.values():
        assert picture.shape == (28, 28, 3)  # a car and a tenth around it
        assert picture[4:-4, 4:-4, 2].min() > 150 > picture[0, 0, 2]


def test_what_appears_or_vanishes_in_a_zone_has_a_mark_without_a_strip(
    tmp_path: Path, run: Run
) -> None:
    yard = """\
camera: {size: [320, 240]}
traffic:
  zones: [{name: yard, points: [[0, 150], [320, 150], [320, 240], [0, 240]]}]
"""
    road = draw_road(tmp_path, CARS[:2], seconds=9, settings=yard)
    page = read_page(write_review(run, tmp_path, road))
    assert [(mark["direction"], mark["band"]) for mark in page.data["marks"]] == [
        *(("appear", None), ("exit", 0)),
        *(("enter", 0), ("vanish", None)),
    ]


def test_coarse_pages_have_no_readable_faces_or_plates(tmp_path: Path, run: Run) -> None:
    large = GATE.replace("start: [20, 120], end: [300, 120]", "start: [60, 120], end: [100, 120]")
    road = draw_road(tmp_path, CARS[:1], seconds=9, settings=large)
    coarse = ("--set", "output.coarse=true", "--overwrite")
    pages = [read_page(write_review(run, tmp_path, road, *options)) for options in ((), coarse)]
    before, after = (page.pictures[0].shape[1] for page in pages)
    columns = pages[0].data["pictures"][0]["columns"]
    assert before == 200 * columns, "40 pixels of the frame, 24 of which are the car"
    assert after == pytest.approx(before * 40 / (200 * 24 / 40), rel=0.02)
    assert pages[0].data["marks"] == pages[1].data["marks"]


def test_the_live_review_equals_that_of_saved_tracks(tmp_path: Path, run: Run) -> None:
    road = draw_road(tmp_path, CARS[:2], seconds=9)
    shared = ["-c", road.settings]
    tracks, live, later = (tmp_path / name for name in ("tracks.jsonl", "live", "later"))
    outputs = ("--no-video", "--tracks", tracks, "--review", live)
    run("detect-video", road.video, *shared, *outputs, code=0)
    run("review", road.video, "--tracks-from", tracks, *shared, "-o", later, code=0)
    pages = [read_page(folder / "review.html") for folder in (live, later)]
    assert pages[0].data["marks"] == pages[1].data["marks"]
    assert (pages[0].pictures[0] == pages[1].pictures[0]).all()
