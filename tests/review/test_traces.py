"""Traces: a vehicle that passes a line without a track is noticed, and little else is."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from browser import browser
from conftest import Run as Invoke
from red_cars import NullDetector
from review_roads import CAR, HEIGHT, Car, draw_road, read_page, write_review
from run.red_runs import outputs
from vdet.boxes import Box, Boxes, Image
from vdet.config.loading import load_settings
from vdet.media import Picture
from vdet.review.strips import Band, Passages, TraceSearch
from vdet.run.loop import Parts
from vdet.run.steps import findings_in
from vdet.run.video import Run, run_video
from vdet.track.track import FrameTracks, Track
from vdet.traffic.counts import Trace

RATE = 12
SAMPLES = 200
BAND = Band("gate", ("in", "out"), (0, 100), (SAMPLES, 100))


@dataclass(frozen=True, slots=True)
class Shape:
    """Something that covers the band from `left`, for some seconds from `time`."""

    time: float
    left: int
    width: int = 40
    seconds: float = 0.5
    level: int = 200
    shade: float | None = None
    """The factor by which a shadow darkens the road."""

    def box(self, time: float) -> Box:
        """Return its box at a time: it comes down the picture."""
        foot = 100 + 60 * (time - self.time) / self.seconds
        return Box(self.left, foot - 60, self.left + self.width, foot)


TRACKED = [Shape(2 + 5 * number, 20 if number % 2 else 120) for number in range(6)]


def strips_of(shapes: Sequence[Shape], seconds: float) -> list[Image]:
    """Return the bands of a textured road with shapes, and the noise of a camera."""
    rng = np.random.default_rng(1)
    road = rng.integers(95, 106, (SAMPLES, 1))
    strips = []
    for index in range(round(seconds * RATE)):
        row = road.repeat(3, axis=1) + rng.integers(-3, 4, (SAMPLES, 3))
        for shape in shapes:
            if shape.time <= index / RATE < shape.time + shape.seconds:
                part = row[shape.left : shape.left + shape.width]
                grey = np.array([0, 128, 128])  # luma, blue and red
                part[:] = grey + shape.shade * (part - grey) if shape.shade else shape.level
        strips.append(row[np.newaxis].astype(np.uint8))
    return strips


def traces_of(strips: Sequence[Image], *, minute: float = 60) -> list[Trace]:
    """Return the traces beside the tracked vehicles, searched minute by minute."""
    passages, frames = Passages([BAND]), []
    for index in range(len(strips)):
        boxes = [shape.box(index / RATE) for shape in TRACKED]
        tracks = (
            Track(n, box, 0.9, "detected") for n, box in enumerate(boxes) if 30 < box.y2 < 170
        )
        frames.append(FrameTracks(index, index / RATE, tuple(tracks)))
        passages.add(frames[-1])
    search, step, traces = TraceSearch(0, BAND), round(minute * RATE), []
    for first in range(0, len(strips), step):
        part = slice(first, first + step)
        is_end = first + step >= len(strips)
        traces += search.search(frames[part], strips[part], passages.by_band[0], is_end=is_end)
    return traces


@pytest.mark.parametrize("minute", [60, 15, 10.2])
def test_a_vehicle_without_a_track_is_a_trace(minute: float) -> None:
    missed = [Shape(10.1, 25), Shape(20, 115, width=50, seconds=0.6)]
    traces = traces_of(strips_of([*TRACKED, *missed], 35), minute=minute)
    assert len(traces) == 2
    for trace, shape in zip(traces, missed, strict=True):
        assert trace.time == pytest.approx(shape.time, abs=0.2)
        assert trace.position == pytest.approx((shape.left + shape.width / 2) / SAMPLES, abs=0.02)


def test_a_vehicle_that_stands_for_some_seconds_is_one_trace() -> None:
    assert len(traces_of(strips_of([*TRACKED, Shape(13.5, 20, seconds=1.9)], 35))) == 1


@pytest.mark.parametrize(
    "shape",
    [
        pytest.param(Shape(10, 30, width=12), id="a person is narrow"),
        pytest.param(Shape(10, 25, seconds=0.1), id="a bird is short"),
        pytest.param(Shape(13, 25, seconds=8), id="what stays does not cross"),
        pytest.param(Shape(10, 70), id="no vehicle drives there"),
        pytest.param(Shape(10, 25, level=103), id="it looks like the road"),
        pytest.param(Shape(7, 15, width=50, seconds=0.55), id="the edge of a tracked vehicle"),
        pytest.param(Shape(10, 25, shade=0.6), id="a shadow keeps the colour and the texture"),
    ],
)
def test_what_is_no_vehicle(shape: Shape) -> None:
    assert traces_of(strips_of([shape, *TRACKED], 35)) == []


def test_a_trembling_camera_and_changes_of_the_light_are_no_vehicles() -> None:
    strips = strips_of(TRACKED, 35)
    strips = [np.roll(strip, index % 3 - 1, axis=1) for index, strip in enumerate(strips)]
    brighter = [strip + np.uint8(7 * (index % 40 > 30)) for index, strip in enumerate(strips)]
    assert traces_of(brighter) == []


class _Known:
    """Follows all cars but two, at their true positions."""

    cars: ClassVar = [
        Car(3 + 4 * number, 80 + 160 * (number % 2), number % 2 == 0) for number in range(12)
    ]
    missed = 4, 9

    def update(self, _: Boxes, time: float, __: Picture | None = None) -> list[Track]:
        boxes = {
            number: Box.sized(car.x - CAR / 2, round(car.foot(time)) - CAR, CAR, CAR)
            for number, car in enumerate(self.cars)
            if number not in self.missed
        }
        return [
            Track(number, box, 0.9, "detected", "car")
            for number, box in boxes.items()
            if box.y1 >= 0 and box.y2 < HEIGHT
        ]


@pytest.mark.parametrize("classes", [(), ("truck",)])
def test_traces_are_in_the_page_the_counts_and_the_findings(
    tmp_path: Path, classes: tuple[str, ...]
) -> None:
    road = draw_road(tmp_path, _Known.cars, seconds=52)
    settings = load_settings([road.settings]).model_copy(update={"classes": classes})
    files = outputs(counts=tmp_path / "counts.json", review=tmp_path / "review")
    totals = run_video(Run(road.video, files, settings), Parts(NullDetector(), _Known()))
    counts = json.loads((tmp_path / "counts.json").read_text())
    page = read_page(tmp_path / "review" / "review.html").data
    assert len(counts["events"]) == (0 if classes else 10)
    times = [_Known.cars[number].time for number in _Known.missed]
    assert [trace["time"] for trace in counts["traces"]] == pytest.approx(times, abs=0.5)
    assert page["traces"] == counts["traces"]
    assert {trace["name"] for trace in counts["traces"]} == {"gate"}
    [finding] = [item for item in findings_in(totals.facts).items if item.code == "traces"]
    number = 0 if classes else 10
    text = f"gate: 2 traces without a vehicle, and {number} counted; 0:00 to 5:00: 2"
    assert finding.text == text
    assert finding.severity == "warning"

    conditions = settings.conditions.model_copy(update={"ignore": ("traces",)})
    ignoring = settings.model_copy(update={"conditions": conditions})
    again = replace(Run(road.video, files, ignoring), overwrite=True)
    totals = run_video(again, Parts(NullDetector(), _Known()))
    assert "traces" not in {item.code for item in findings_in(totals.facts).items}


def test_a_click_on_a_trace_adds_a_missed_vehicle(tmp_path: Path, run: Invoke) -> None:
    cars = [*_Known.cars[:7], Car(20.2, 240, goes_up=False)]
    page = write_review(run, tmp_path, draw_road(tmp_path, cars, missed=4, seconds=30))
    [trace], marks = (read_page(page).data[name] for name in ("traces", "marks"))
    [beside] = (item["moment"] for item in marks if abs(item["seconds"] - trace["time"]) < 2)
    assert re.findall(r'id="(moment-[^"]*)"', page.read_text("utf-8")) == [beside]
    with browser(tmp_path) as window:
        window.open(page)
        assert window.run("return document.querySelectorAll('.mark').length") == 8
        window.run("document.querySelector('.trace').click()")
        left = "return [document.querySelectorAll('.trace').length, inSpan().length]"
        assert window.run(left) == [0, 8]
        [added] = window.run("return state.missed")
    assert (added["line"], added["direction"]) == ("gate", "away")
    assert added["seconds"] == pytest.approx(trace["time"])
    assert added["position"] == trace["position"]
