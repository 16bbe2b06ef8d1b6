"""Make the pictures of docs/: the program on drawn roads. That of a strip needs Chromium."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np

from vdet.boxes import Image
from vdet.media.images import read_image
from vdet.media.reader import VideoReader
from vdet.synthetic import (
    LANE_WIDTH,
    Body,
    PinholeCamera,
    Scene,
    SceneVehicle,
    Waypoint,
    empty_road,
    write_clip,
)

FOLDER = Path(__file__).parent
COUNTED_FRAME = 62  # of the demo's pole: half of the vehicles are counted
STRIP = 1400, 2220, 20, 770
"""Top, bottom, left and right of the part of the review page with six vehicles, pixels."""
STAGES = ("1-windows", "3-hits", "4-heat", "6-boxes")

_SEED = 11
_VAN = Body(width=1.9, length=4.9, boot=0.06, slope=0.12, height=1.92, belt=1.12)
_OFF_ROADER = Body(width=1.88, length=4.7, boot=0.12, slope=0.35, height=1.72, belt=1.04)
_HATCHBACK = Body(length=4.2, boot=0.15, slope=0.5, height=1.48)
_VEHICLES = (
    (_OFF_ROADER, 14.5, -LANE_WIDTH, (120, 62, 28)),
    (_HATCHBACK, 17.0, LANE_WIDTH, (22, 16, 130)),
    (Body(), 27.0, 0.1, (228, 228, 226)),
    (Body(), 42.0, LANE_WIDTH, (60, 54, 50)),
    (_VAN, 40.0, -LANE_WIDTH, (225, 228, 230)),
)
"""Shape, metres ahead, metres to the right, and colour (BGR)."""


def motorway() -> Scene:
    """Return a road with three lanes and five vehicles, 22 frames."""
    camera = PinholeCamera.dashboard(1280, 720, curvature=1 / 1500)
    road = empty_road(np.random.default_rng(_SEED), camera, lane=1, lanes=3, seed=_SEED)
    vehicles = tuple(
        SceneVehicle(id=number, path=_steady(ahead, lateral), color=color, body=body)
        for number, (body, ahead, lateral, color) in enumerate(_VEHICLES, start=1)
    )
    light = replace(road.light, gain=1.1, noise=1.0, sun=0.5)
    return replace(road, vehicles=vehicles, light=light, frames=22)


def _steady(ahead: float, lateral: float) -> tuple[Waypoint, Waypoint]:
    return Waypoint(0, ahead, lateral), Waypoint(1, ahead + 0.3, lateral)


def frame_with_vehicles(source: Path, index: int, *words: str) -> Image:
    """Run `vdet detect-video` and return a frame of its video."""
    found = source.with_name(f"{source.stem}_found.mp4")
    words = (*words, *_settings("output.crf=6"))
    program = (sys.executable, "-m", "vdet", "detect-video", str(source), str(found))
    subprocess.run([*program, *words], check=True)
    with VideoReader(found) as reader:
        return next(frame.image for frame in reader if frame.index == index)


def strip(folder: Path) -> Image:
    """Write the review of the demo's pole camera, and return a part of its page."""
    source, review, shown = folder / "pole.mp4", folder / "review", folder / "review.png"
    program = (sys.executable, "-m", "vdet", "detect-video", str(source), "--no-video")
    words = ("-c", str(folder / "gate.yaml"), "--review", str(review))
    subprocess.run([*program, *words], check=True)
    browser = ("chromium", "--headless=new", "--no-sandbox", "--window-size=1400,2400")
    address = (review / "review.html").resolve().as_uri()
    command = [*browser, f"--screenshot={shown}", address]
    subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
    top, bottom, left, right = STRIP
    return read_image(shown)[top:bottom, left:right]


def _settings(*assignments: str) -> list[str]:
    return [word for each in assignments for word in ("--set", each)]


def stages(folder: Path) -> Image:
    """Return four stages of the linear model in one picture, 1200 pixels wide."""
    tiles = [cv2.resize(read_image(folder / f"{name}.png"), (600, 338)) for name in STAGES]
    return np.asarray(np.vstack([np.hstack(tiles[:2]), np.hstack(tiles[2:])]), np.uint8)


def main() -> None:
    """Write the pictures."""
    with TemporaryDirectory() as name:
        demo, road = Path(name) / "demo", Path(name) / "motorway.mp4"
        subprocess.run([sys.executable, "-m", "vdet", "demo", demo], check=True)
        write_clip(road, motorway())
        label: tuple[str, ...] = ("--lanes", *_settings("draw.label=[id, score]"))
        counts = (
            "-c",
            str(demo / "gate.yaml"),
            *_settings("draw.trails=3"),
        )
        pictures = {
            "vdet": frame_with_vehicles(road, 21, *label),
            "counts": frame_with_vehicles(demo / "pole.mp4", COUNTED_FRAME, *counts),
            "stages": stages(demo / "stages"),
            "strip": strip(demo),
        }
    for name, image in pictures.items():
        _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 88])
        (FOLDER / f"{name}.jpg").write_bytes(data.tobytes())


if __name__ == "__main__":
    main()
