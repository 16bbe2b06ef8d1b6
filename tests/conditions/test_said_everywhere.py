"""Every doubt about a video is said at every step: 35 cells of a table."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import openpyxl
import pytest
from benchmarks.conditions import CHANGES, SETTINGS
from benchmarks.zero import RATE, SIZE, road, traffic

from conftest import Run as Program
from red_cars import NullDetector
from run.red_runs import outputs
from running import write_images
from vdet import load_settings
from vdet.boxes import Image
from vdet.config.loading import render_settings
from vdet.run.loop import Parts
from vdet.run.sinks import Output
from vdet.run.video import Run, run_video
from vdet.synthetic import Renderer

FRAMES = 6 * RATE
OTHER = Renderer(road(3, speed=20.0)).image(0)
WITHOUT_LINES = load_settings("svm")
"""The recall of this detector is not known, so poor visibility is a warning."""
WITH_LINES = WITHOUT_LINES.model_copy(update={"traffic": SETTINGS.traffic})
Change = Callable[[Image, int], Image]


def pan(image: Image, index: int) -> Image:
    wide = cv2.copyMakeBorder(image, 0, 0, 0, 20 * FRAMES, cv2.BORDER_REFLECT_101)
    return np.asarray(wide[:, 20 * index : 20 * index + SIZE[0]], np.uint8)


def cut(image: Image, index: int) -> Image:
    return OTHER if 2 * index >= FRAMES else image


def changed(name: str) -> Change:
    return lambda image, _: CHANGES[name](image, np.random.default_rng(1), 0.0)


WAYS: dict[str, tuple[Change, str]] = {
    "pan": (pan, "the camera moves"),
    "dark": (changed("night"), "it is dark"),
    "haze": (changed("fog"), "contrast is low"),
    "cut": (cut, "the video was cut at 0:03"),
    "water": (changed("drops"), "water or dirt on the lens"),
}


def text_of(path: Path) -> str:
    """Return the text of an output: of a workbook, that of its summary."""
    if path.suffix == ".xlsx":
        rows = openpyxl.load_workbook(path)["Summary"].values
        return " ".join(str(cell) for row in rows for cell in row if cell is not None)
    if path.is_dir():
        [path] = path.glob("*.html")
    return path.read_text()


@pytest.fixture(scope="module")
def clean() -> list[Image]:
    renderer = Renderer(traffic(1))
    return [renderer.image(index) for index in range(FRAMES)]


def test_a_still_scene_is_said_where_its_count_of_0_is(
    tmp_path: Path, run: Program, clean: list[Image], caplog: pytest.LogCaptureFixture
) -> None:
    clip, tracks, gate = (tmp_path / name for name in ("in.mp4", "tracks.jsonl", "gate.yaml"))
    write_images(clip, [clean[0]] * FRAMES, rate=RATE)
    gate.write_text(render_settings(SETTINGS))
    written = outputs(counts=tmp_path / "c.xlsx", page=tmp_path / "page", tracks=tracks)
    run_video(Run(clip, written, WITH_LINES), Parts(NullDetector()))
    again = ("--counts", tmp_path / "again.xlsx", "--page", tmp_path / "again")
    said = run("count", tracks, "-c", gate, "--strict", *again, code=0).err
    texts = [text_of(tmp_path / name) for name in ("c.xlsx", "page", "again.xlsx", "again")]
    assert all("no vehicle was found, and nothing moved" in text for text in (said, *texts))
    assert not caplog.text


@pytest.mark.parametrize("way", WAYS)
def test_a_doubt_is_said_at_every_step(
    tmp_path: Path, run: Program, way: str, clean: list[Image], caplog: pytest.LogCaptureFixture
) -> None:
    change, words = WAYS[way]
    clip, tracks, gate = (tmp_path / name for name in ("in.mp4", "tracks.jsonl", "gate.yaml"))
    images = [change(image, index) for index, image in enumerate(clean)]
    write_images(clip, images, rate=RATE)
    gate.write_text(render_settings(SETTINGS))
    files = {".json": "c.json", ".xlsx": "c.xlsx", "page": "page", "review": "review"}
    sinks = zip(("counts", "counts", "page", "review"), files.values(), strict=True)
    written = tuple(Output(sink, tmp_path / name) for sink, name in sinks)

    run_video(Run(clip, outputs(tracks=tracks), WITHOUT_LINES), Parts(NullDetector()))
    assert (words in caplog.text) is (way != "pan")  # every dashcam moves
    caplog.clear()
    run_video(Run(clip, written, WITH_LINES), Parts(NullDetector()))
    places = {"terminal": caplog.text}
    places |= {place: text_of(tmp_path / name) for place, name in files.items()}
    counted = run("count", tracks, "-c", gate, "--strict", code=4)
    drawn = run("draw", clip, "--tracks-from", tracks, "-o", tmp_path / "draw.html")
    places |= {"count of saved tracks": counted.err, "draw": text_of(tmp_path / "draw.html")}
    assert words in drawn.err
    assert {place for place, text in places.items() if words not in text} == set()
    assert len(places) == 7
