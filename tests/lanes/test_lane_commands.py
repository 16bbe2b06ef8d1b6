"""Lanes through the commands, on a clip with strong lens distortion."""

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from conftest import Run
from lanes.roads import make_road, settings_for
from red_cars import SETTINGS, red_finder
from running import write_images
from vdet.boxes import Box, Image
from vdet.config.kinds import WindowSettings
from vdet.config.scene import LensSettings
from vdet.config.schema import LaneSettings, OutputSettings, Settings
from vdet.config.section import REFERENCE_HEIGHT, scale_lengths
from vdet.detect.svm.model import save_model
from vdet.draw import color_of
from vdet.lanes.camera import Undistorter, save_camera
from vdet.media.images import read_image
from vdet.media.reader import VideoReader
from vdet.synthetic import PinholeCamera, Renderer, Scene
from writing import write_image

WIDTH, HEIGHT, COUNT = 640, 480, 10
LENS = LensSettings(
    size=(WIDTH, HEIGHT),
    matrix=((480, 0, 320), (0, 480, 240), (0, 0, 1)),
    distortion=(-0.35, 0.1, 0.0, 0.0, 0.0),
)
CAR = Box.sized(500, 300, 64, 56)  # in the distorted frame, near its edge
CORNER = np.s_[400:, 600:]
"""Pixels without drawings."""
PLACE = "distance", "lane"
"""Keys of the place of a vehicle."""


@dataclass(frozen=True)
class Files:
    """The input files of the commands."""

    clip: Path
    """A bend, distorted by the lens, and a red car that stays in one place of the frame."""
    picture: Path
    """Its first frame."""
    camera: Path
    settings: Path
    model: Path

    @property
    def red(self) -> tuple[str | Path, ...]:
        """The options that find red cars."""
        return "-c", self.settings, "--model", self.model

    @property
    def lanes(self) -> tuple[str | Path, ...]:
        """The options that find red cars and the lane."""
        return *self.red, "-c", self.camera, "--lanes"


@pytest.fixture(scope="module")
def undistorter() -> Undistorter:
    return Undistorter(LENS, WIDTH, HEIGHT)


@pytest.fixture(scope="module")
def road() -> Scene:
    return make_road(curvature=1 / 500, size=(WIDTH, HEIGHT), frames=COUNT)


@pytest.fixture(scope="module")
def files(road: Scene, undistorter: Undistorter, tmp_path_factory: pytest.TempPathFactory) -> Files:
    folder = tmp_path_factory.mktemp("lanes")
    names = ("clip.mp4", "frame.png", "camera.yaml", "my.yaml", "red.npz")
    made = Files(*(folder / name for name in names))
    renderer = Renderer(road)
    seen = [with_car(distorted(renderer.image(i), undistorter)) for i in range(COUNT)]
    write_images(made.clip, seen, crf=10)
    write_image(made.picture, seen[0])
    save_camera(LENS, made.camera)
    settings = red_settings(settings_for(road.camera))
    values = settings.model_dump(mode="json")
    made.settings.write_text(yaml.safe_dump(values), encoding="utf-8")
    save_model(red_finder(), made.model)
    return made


def distorted(image: Image, undistorter: Undistorter) -> Image:
    """Distort the picture of an ideal camera as the lens would."""
    columns, rows = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    pixels = np.column_stack([columns.ravel(), rows.ravel()]).astype(np.float64)
    x, y = undistorter.points(pixels).T.reshape(2, HEIGHT, WIDTH).astype(np.float32)
    return np.asarray(cv2.remap(image, x, y, cv2.INTER_LINEAR), np.uint8)


def with_car(image: Image) -> Image:
    CAR.cut(image)[:] = (0, 0, 255)
    return image


def red_settings(lanes: LaneSettings) -> Settings:
    band = WindowSettings(size=32, overlap=0.75, top=280, bottom=400)
    windows = (scale_lengths(band, REFERENCE_HEIGHT / HEIGHT),)
    search = SETTINGS.svm.search.model_copy(update={"windows": windows})
    detector = SETTINGS.svm.model_copy(update={"search": search})
    tracker = scale_lengths(SETTINGS.tracker, 1 / 2)  # `SETTINGS` is for frames half as high
    output = OutputSettings(crf=4)
    return Settings(detector=detector, tracker=tracker, lanes=lanes, output=output)


def video_images(path: Path) -> list[Image]:
    with VideoReader(path) as reader:
        return [frame.image for frame in reader]


def box_of(item: dict[str, Any]) -> Box:
    return Box.sized(item["x"], item["y"], item["width"], item["height"])


def check_lane(lane: dict[str, Any], camera: PinholeCamera, lens: Undistorter) -> None:
    """Compare a lane in JSON, in pixels of a frame behind a lens, with the road that was drawn."""
    assert set(lane) == {"radius", "offset", "width", "left", "right"}
    assert lane["radius"] == pytest.approx(1 / camera.curvature, rel=0.25)
    assert lane["offset"] == pytest.approx(0, abs=0.1)
    assert lane["width"] == pytest.approx(3.7, abs=0.1)
    for name, lateral in (("left", -1.85), ("right", 1.85)):
        x, y = lens.points(np.array(lane[name])).T
        distance = camera.focal * camera.above_ground / (y - camera.horizon)
        truth = np.column_stack([np.full_like(x, lateral), np.zeros_like(x), distance])
        metres = (x - camera.project(truth)[:, 0]) * distance / camera.focal
        assert np.abs(metres).max() < 0.3
        assert abs(metres[0]) < 0.1
        assert (np.diff(y) < 0).all()


def check_place(item: dict[str, Any], camera: PinholeCamera, lens: Undistorter) -> None:
    """Compare the distance and the lane of a vehicle with those of its foot on the road."""
    [[x, y]] = lens.points(np.array([item["foot"]]) - 0.5).tolist()
    metres = camera.focal * camera.above_ground / (y - camera.horizon)
    assert item["distance"] == pytest.approx(metres, rel=0.1)
    assert item["lane"] == round((x - 320) * metres / camera.focal / 3.7)


def sits_on(box: Box, car: Box) -> bool:
    """Tell whether a box encloses a car and has the same middle."""
    (x, y), (car_x, car_y) = box.center, car.center
    return box.intersection(car) == car and abs(x - car_x) < 6 and abs(y - car_y) < 6


def is_red(image: Image, x: float, y: float) -> bool:
    """Tell whether a line of the lane is drawn through a point."""
    blue, green, red = image[round(y), min(round(x), WIDTH - 1)].astype(int)
    return bool(red > 1.5 * max(blue, green))


def has_outline(image: Image, box: Box, color: tuple[int, int, int]) -> bool:
    """Tell whether the lower side of a box is drawn; video has half the rows of chroma."""
    side = Box(box.x1 + 4, box.y2 - 1, box.x2 - 4, box.y2).cut(image)[0].astype(int)
    return bool((np.abs(side - color).max(axis=1) < 90).mean() > 0.8)


def test_the_lane_and_the_boxes_of_a_video_are_reported_and_drawn_in_its_frames(
    run: Run, files: Files, tmp_path: Path, road: Scene, undistorter: Undistorter
) -> None:
    out, tracks = tmp_path / "out.mp4", tmp_path / "t.jsonl"
    run("detect-video", files.clip, out, "--tracks", tracks, *files.lanes, code=0)
    records = [json.loads(line) for line in tracks.read_text().splitlines()]
    for record in records:
        check_lane(record["lane"], road.camera, undistorter)
    boxes = [box_of(track) for record in records for track in record["tracks"]]
    assert len(boxes) > COUNT // 2
    assert all(sits_on(box, CAR) for box in boxes), "in pixels of the input"
    before, after = video_images(files.clip), video_images(out)
    assert len(before) == len(after) == len(records) == COUNT
    for old, new in zip(before, after, strict=True):
        assert np.abs(new[CORNER] - old[CORNER].astype(int)).mean() < 2
    (track,) = records[-1]["tracks"]
    check_place(track, road.camera, undistorter)
    assert has_outline(after[-1], box_of(track), color_of(track["id"]))
    for side in ("left", "right"):
        assert all(is_red(after[-1], *point) for point in records[-1]["lane"][side][:20])


def test_the_lane_and_the_boxes_of_a_picture_are_reported_and_drawn(
    run: Run, files: Files, tmp_path: Path, road: Scene, undistorter: Undistorter
) -> None:
    out = tmp_path / "out.png"
    options = ("-o", out, "--json", "-", *files.lanes)
    (item,) = json.loads(run("detect-image", files.picture, *options, code=0).out)
    check_lane(item["lane"], road.camera, undistorter)
    (reported,) = map(box_of, item["boxes"])
    assert sits_on(reported, CAR)
    check_place(item["boxes"][0], road.camera, undistorter)
    drawn = read_image(out)
    assert has_outline(drawn, reported, color_of(1))
    assert (drawn[CORNER] == read_image(files.picture)[CORNER]).all()


def test_without_a_camera_no_output_of_a_video_has_metres(
    run: Run, files: Files, tmp_path: Path, road: Scene
) -> None:
    renderer, clip, out = Renderer(road), tmp_path / "plain.mp4", tmp_path / "out.mp4"
    write_images(clip, [with_car(renderer.image(i)) for i in range(COUNT)], crf=10)
    tracks, vehicles, page = (tmp_path / name for name in ("t.jsonl", "v.json", "v.page"))
    outputs = "--tracks", tracks, "--sink", f"vehicles={vehicles}", "--page", page
    result = run("detect-video", clip, out, *outputs, *files.red, "--lanes")
    assert (result.code, result.err.count("warning")) == (0, 0)
    assert "note: lanes: no values in metres without camera.lens\n" in result.err
    records = [json.loads(line) for line in tracks.read_text().splitlines()]
    metres = ("radius", "offset", "width")
    assert [record["lane"][key] for record in records for key in metres] == [None] * 3 * COUNT
    assert all(len(record["lane"][side]) > 1 for record in records for side in ("left", "right"))
    places = [track[key] for record in records for track in record["tracks"] for key in PLACE]
    assert places
    assert set(places) == {None}
    (vehicle,) = json.loads(vehicles.read_text())
    speeds = ("metres", "speed", "speed_85", "speed_sd")
    assert {vehicle[key] for key in (*speeds, *PLACE)} == {None}
    text = re.sub(r"<(script|style).*?</\1>", "", (page / "page.html").read_text(), flags=re.DOTALL)
    assert not re.search(r"\d\s*(m|km/h)\b", re.sub("<[^>]*>", " ", text))
    for old, new in zip(video_images(clip), video_images(out), strict=True):
        assert np.abs(new[:60] - old[:60].astype(int)).mean() < 2, "no text about the lane"
        assert np.abs(new[300:] - old[300:].astype(int)).mean() > 5, "the lane is drawn"
