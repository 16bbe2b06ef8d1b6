"""A drawn road with known vehicles, its tracks, and the page on which they are checked."""

import json
import re
from base64 import b64decode
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from conftest import Run

SIZE = WIDTH, HEIGHT = 320, 240
RATE = 10
SPEED = 8  # pixels a frame
CAR = 24  # pixels, width and height
LINE_Y = 120
GATE = f"""\
camera: {{size: [{WIDTH}, {HEIGHT}]}}
traffic:
  lines: [{{name: gate, start: [20, {LINE_Y}], end: [300, {LINE_Y}], left: away, right: here}}]
"""


@dataclass(frozen=True, slots=True)
class Car:
    """A red car whose foot crosses the line at a time, seconds, going up or down at x."""

    time: float
    x: int
    goes_up: bool = True

    def foot(self, time: float) -> float:
        way = (time - self.time) * RATE * SPEED
        return LINE_Y - way if self.goes_up else LINE_Y + way


@dataclass(frozen=True, slots=True)
class Road:
    """A video of cars, and the tracks of those that were counted."""

    video: Path
    tracks: Path
    settings: Path


def draw_road(
    folder: Path,
    cars: list[Car],
    *,
    missed: int | None = None,
    seconds: int,
    settings: str = GATE,
    is_side_on: bool = False,
) -> Road:
    """Draw cars; the tracks lack the one with the number `missed`.

    With `is_side_on` their feet are `x` pixels from the top, and cross the middle to the right.
    """
    road = Road(folder / "in.mp4", folder / "tracks.txt", folder / "gate.yaml")
    road.settings.write_text(settings)
    rows = []
    with av.open(str(road.video), "w") as container:
        stream = container.add_stream("libx264", rate=Fraction(RATE), options={"crf": "10"})
        assert isinstance(stream, av.VideoStream)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        for index in range(seconds * RATE):
            image = np.full((HEIGHT, WIDTH, 3), 110, np.uint8)
            for number, car in enumerate(cars):
                foot, left = round(car.foot(index / RATE)), car.x - CAR // 2
                if is_side_on:
                    foot, left = car.x, foot + WIDTH // 2 - LINE_Y - CAR // 2
                if CAR <= foot < HEIGHT and 0 <= left <= WIDTH - CAR:
                    image[foot - CAR : foot, left : left + CAR] = 30, 30, 220
                    if number != missed:
                        box = f"{left},{foot - CAR},{CAR},{CAR}"
                        rows.append(f"{index + 1},{number + 1},{box},0.9,-1,-1,-1")
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="bgr24")))
        container.mux(stream.encode(None))
    road.tracks.write_text("\n".join(rows) + "\n")
    return road


def write_review(run: Run, folder: Path, road: Road, *options: str) -> Path:
    """Write the page of a road by `vdet review`, and return its path."""
    output, saved = folder / "review", ("--tracks-from", road.tracks)
    run("review", road.video, *saved, "-c", road.settings, "-o", output, *options, code=0)
    return output / "review.html"


@dataclass(frozen=True, slots=True, eq=False)
class Page:
    """What a page holds: the values of its script, and its pictures, BGR.

    `pictures` are those of the strip by minute, `crops` those of vehicles by id.
    """

    data: dict[str, Any]
    pictures: dict[int, NDArray[np.uint8]]
    crops: dict[int, NDArray[np.uint8]]

    def streaks(self, minute: int) -> list[tuple[float, float]]:
        """Return seconds and position of the middle of each red streak, in order of time."""
        [layout] = [item for item in self.data["pictures"] if item["minute"] == minute]
        picture = self.pictures[minute]
        rows_a_second = layout["rows"] / (layout["seconds"] + layout["lead"])
        columns = np.split(picture, layout["columns"], axis=1)
        width, lead = picture.shape[1] / len(columns), round(layout["lead"] * rows_a_second)
        strip = np.concatenate([column[lead:] for column in columns]).astype(int)  # time runs down
        red = (strip[..., 2] - strip[..., 1] > 80).astype(np.uint8)
        _, _, stats, middles = cv2.connectedComponentsWithStats(red)
        areas = zip(stats.tolist()[1:], middles.tolist()[1:], strict=True)
        return sorted(
            (60 * minute + y / rows_a_second, x / width) for (*_, area), (x, y) in areas if area > 9
        )


def read_page(path: Path) -> Page:
    text = path.read_text("utf-8")
    match = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)
    assert match
    pictures, crops = (
        {int(number): _picture(data) for number, data in re.findall(f'id="{name}">([^<]*)<', text)}
        for name in (r"strip-0-(\d+)", r"crop-(\d+)")
    )
    return Page(json.loads(match[1]), pictures, crops)


def _picture(data: str) -> NDArray[np.uint8]:
    decoded = cv2.imdecode(np.frombuffer(b64decode(data), np.uint8), cv2.IMREAD_COLOR)
    return np.asarray(decoded, np.uint8)
