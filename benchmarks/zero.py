"""Is a count of nothing doubted where vehicles move, and only there? Are jump cuts found?

    python -m benchmarks.zero           # drawn clips: 3 minutes
    python -m benchmarks.zero CLIPS     # and the cuts of the videos in a folder
    python -m benchmarks.zero CLIPS 50  # other drawn clips, from this seed

No vehicle is found in any clip. In 40 drawn ones there is none: people, trees, rain, snow, clouds,
glare or insects move before a camera on a pole, or the camera drives on an empty road. In the
others vehicles drive by day, in the dark and in fog. Last come clips in which nothing moves, or
all vehicles have tracks. Of 100 more, half are put together of two.
"""

import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np

from benchmarks.conditions import CHANGES, SETTINGS
from benchmarks.drawn_traffic import true_tracks
from vdet.boxes import NO_BOXES, Image
from vdet.conditions.cuts import with_cuts
from vdet.conditions.watch import Conditions
from vdet.config.schema import Settings
from vdet.findings import Finding
from vdet.media import Frame, Picture
from vdet.media.reader import VideoReader
from vdet.synthetic import PinholeCamera, Renderer, Scene, demo_scene, empty_road, pole_scene

SIZE = 640, 360
RATE, SECONDS = 5, 12
Overlay = Callable[[Image, float], Image]
"""Draws what moves into a frame at a time, seconds."""


def _blob(image: Image, x: float, y: float, size: tuple[float, float], level: float) -> None:
    """Draw an ellipse of half axes `size`, in place."""
    axes = max(1, round(size[0])), max(1, round(size[1]))
    center = round(x), round(y)
    cv2.ellipse(image, center, axes, 0, 0, 360, (level,) * 3, -1, cv2.LINE_AA)


def people(rng: np.random.Generator) -> Overlay:
    """People who walk along or across."""
    width, height = SIZE
    walkers = []
    for _ in range(int(rng.integers(1, 5))):
        tall, y = height * rng.uniform(0.08, 0.25), height * rng.uniform(0.45, 0.95)
        speed = tall * rng.uniform(0.6, 1.0) * rng.choice((-1, 1))  # 1.0 to 1.8 m/s
        walkers.append((tall, y, speed, rng.uniform(0, width), rng.uniform(20, 230), rng.random()))

    def draw(image: Image, time: float) -> Image:
        for tall, y, speed, start, level, off in walkers:
            x, step = start + speed * time, 0.16 * tall * np.sin(6 * time + 6 * off)
            for side in (-step, step):
                hip, foot = (round(x), round(y - 0.45 * tall)), (round(x + side), round(y))
                cv2.line(image, hip, foot, (level * 0.6,) * 3, max(1, round(0.09 * tall)))
            _blob(image, x, y - 0.65 * tall, (0.13 * tall, 0.22 * tall), level)
            _blob(image, x, y - 0.93 * tall, (0.06 * tall, 0.08 * tall), 120)
        return image

    return draw


def trees(rng: np.random.Generator) -> Overlay:
    """Crowns beside the road that sway in the wind."""
    width, height = SIZE
    crowns = [
        (
            rng.choice((0.08, 0.92)) * width + rng.uniform(-50, 50),
            rng.uniform(0, 0.5) * height,
            *(rng.uniform(20, 70), rng.uniform(2, 12), rng.uniform(1, 3), rng.uniform(0, 6)),
        )
        for _ in range(5)
    ]

    def draw(image: Image, time: float) -> Image:
        for x, y, size, far, speed, phase in crowns:
            for leaf in range(30):
                angle, part = 2.4 * leaf, (leaf / 30) ** 0.5
                sway = far * np.sin(speed * time + phase) + 3 * np.sin(7 * time + leaf)
                place = x + sway + part * size * np.cos(angle), y + part * size * np.sin(angle)
                _blob(image, *place, (0.2 * size, 0.16 * size), 45 + 2 * (leaf % 20))
        return image

    return draw


def rain(rng: np.random.Generator) -> Overlay:
    """Streaks, another set in each frame."""
    count, length = int(rng.integers(150, 900)), rng.uniform(8, 40)

    def draw(image: Image, time: float) -> Image:
        random, streaks = np.random.default_rng(int(1000 * time)), np.zeros_like(image)
        for x, y in random.uniform((0, -20), SIZE, (count, 2)):
            size = length * random.uniform(0.5, 1.5)
            end = round(x + 0.15 * size), round(y + size)
            cv2.line(streaks, (round(x), round(y)), end, (70, 70, 70), 1)
        return np.asarray(cv2.add(image, cv2.GaussianBlur(streaks, (3, 3), 0)), np.uint8)

    return draw


def snow(rng: np.random.Generator) -> Overlay:
    """Flakes that fall with the wind, near ones large and soft."""
    width, height = SIZE
    count = int(rng.integers(100, 500))
    near = rng.uniform(0, 1, count) ** 3
    start, wind = rng.uniform((0, 0), SIZE, (count, 2)), rng.uniform(-120, 120)

    def draw(image: Image, time: float) -> Image:
        flakes = np.zeros_like(image)
        for (x0, y0), size in zip(start, near, strict=True):
            fall = 60 + 300 * size
            x = (x0 + wind * (0.4 + size) * time + 10 * np.sin(3 * time + x0)) % width
            _blob(flakes, x, (y0 + fall * time) % height, (1 + 7 * size,) * 2, 200 - 120 * size)
        return np.asarray(cv2.add(image, cv2.GaussianBlur(flakes, (3, 3), 0)), np.uint8)

    return draw


def clouds(rng: np.random.Generator) -> Overlay:
    """Shadows of clouds that cross the scene."""
    width, height = SIZE
    field = rng.normal(size=(6, 14)).astype(np.float32)
    wide = cv2.resize(field, (3 * width, height), interpolation=cv2.INTER_CUBIC)
    shade = 1 - rng.uniform(0.2, 0.5) / (1 + np.exp(-3 * wide))
    speed = rng.uniform(20, 120)

    def draw(image: Image, time: float) -> Image:
        left = round(speed * time) % (2 * width)
        return np.asarray(image * shade[:, left : left + width, np.newaxis], np.uint8)

    return draw


def glare(rng: np.random.Generator) -> Overlay:
    """A reflection on the lens that swells and drifts, and a light that flickers."""
    width, height = SIZE
    x0, y0 = rng.uniform((0.1, 0.1), (0.9, 0.7))
    drift, size = rng.uniform(-15, 15, 2), rng.uniform(15, 60)

    def draw(image: Image, time: float) -> Image:
        light = np.zeros_like(image)
        level = 110 + 90 * np.sin(0.7 * time + x0)
        place = x0 * width + drift[0] * time, y0 * height + drift[1] * time
        _blob(light, *place, (size, size), level)
        _blob(light, 0.9 * width, 0.1 * height, (6, 6), 200.0 * (int(10 * time) % 2))
        soft = cv2.GaussianBlur(light, (0, 0), 0.5 * size)
        return np.asarray(cv2.add(image, soft), np.uint8)

    return draw


def insects(rng: np.random.Generator) -> Overlay:
    """Insects near the lens: fast, soft, and in curves; one sits and walks."""
    flights = [
        (*rng.uniform((0, 0, 0), (SECONDS - 1, *SIZE)), *rng.normal(0, 250, 2), rng.random())
        for _ in range(int(rng.integers(5, 25)))
    ]
    sits = rng.uniform((0, 0), SIZE)

    def draw(image: Image, time: float) -> Image:
        for start, x, y, x_speed, y_speed, turn in flights:
            if 0 <= (past := time - start) <= 1.5:
                curve = 60 * np.sin(9 * past + 6 * turn)
                place = x + x_speed * past + curve, y + y_speed * past - curve
                _blob(image, *place, (4 + 12 * turn, 3 + 8 * turn), 40 + 150 * (turn > 0.5))
        angle = 0.8 * np.sin(time) + time / 3
        _blob(image, sits[0] + 30 * np.cos(angle), sits[1] + 30 * np.sin(angle), (7, 5), 30)
        return np.asarray(cv2.GaussianBlur(image, (3, 3), 0), np.uint8)

    return draw


MOVING = (people, trees, rain, snow, clouds, glare, insects)


@dataclass(frozen=True)
class Clip:
    """A clip at `RATE`: a scene with what moves in it, and how it is changed."""

    scene: Scene
    overlay: Overlay | None = None
    change: str = ""
    is_tracked: bool = False

    def findings(self) -> tuple[Finding, ...]:
        """Return the findings; without tracks, unless all vehicles have one."""
        settings = Settings() if self.scene.speed else SETTINGS  # lines are for fixed cameras
        watch = Conditions(settings, self.scene.camera.width)
        renderer = Renderer(self.scene)
        for index in range(self.scene.frames):
            time, image = self.scene.time(index), renderer.image(index)
            if self.overlay:
                image = self.overlay(image, time)
            if self.change:
                image = CHANGES[self.change](image, np.random.default_rng(self.scene.seed), time)
            tracks = true_tracks(self.scene, index) if self.is_tracked else ()
            watch.add(time, Picture(image), NO_BOXES, tracks)
        return watch.findings().items


def road(seed: int, *, speed: float = 0.0) -> Scene:
    """Return an empty road: from a pole, or from a windscreen at a speed in m/s."""
    rng = np.random.default_rng(seed)
    camera = PinholeCamera.dashboard(*SIZE) if speed else PinholeCamera.pole(*SIZE)
    scene = empty_road(rng, camera, lane=1, lanes=3, seed=seed)
    scene = replace(scene, speed=speed, rate=Fraction(RATE), frames=RATE * SECONDS)
    return scene if speed else replace(scene, roadside=())


def traffic(seed: int) -> Scene:
    """Return a road from a pole with eight cars."""
    scene = pole_scene(seed)
    return replace(scene, camera=PinholeCamera.pole(*SIZE), rate=Fraction(RATE), frames=RATE * 10)


def shot(seed: int, frames: int) -> list[Image]:
    """Return some frames, 25 a second: from a pole, or, at odd seeds, from a windscreen."""
    scene = traffic(seed)
    if seed % 2:
        scene = replace(demo_scene(seed), camera=PinholeCamera.dashboard(*SIZE))
    renderer = Renderer(replace(scene, rate=Fraction(25), frames=250))
    first = int(np.random.default_rng(seed).integers(20, 100))
    return [renderer.image(first + number) for number in range(frames)]


def cut_of(seed: int) -> tuple[list[Image], int]:
    """Return a clip put together of two, and the number of the first frame of the second."""
    place = 15 + seed % 20
    return [*shot(seed, place), *shot(seed + 101 + seed % 3, 12)], place


def cuts_in(images: Iterable[Image]) -> list[int]:
    """Return the numbers of the frames that begin a shot."""
    frames = (Frame(n, Fraction(n, 25), Picture(image)) for n, image in enumerate(images))
    return [index for index, cut in with_cuts((frame, frame.index) for frame in frames) if cut]


def compare_cuts(first: int) -> None:
    """Print how many of the cuts are found, and how many others."""
    pairs = [cut_of(first + number) for number in range(50)]
    found = sum(cuts_in(images) == [place] for images, place in pairs)
    false = sum(bool(cuts_in(shot(first + number, 36))) for number in range(50))
    print(f"cuts: {found} of {len(pairs)} found; {false} in 50 clips without", flush=True)
    for path in sorted(Path(sys.argv[1]).glob("*.mp4")) if sys.argv[1:] else ():
        with VideoReader(path) as reader:
            print(f"cuts in {path.stem}: {cuts_in(frame.image for frame in reader)}", flush=True)


def compare(name: str, clips: Sequence[Clip]) -> None:
    """Print how many clips have a warning, and the codes of all findings."""
    found = [clip.findings() for clip in clips]
    warned = sum(any(item.severity == "warning" for item in items) for items in found)
    codes = sorted({f"{item.code} ({item.severity})" for items in found for item in items})
    print(f"{name:22} warnings in {warned} of {len(found)}: {', '.join(codes)}", flush=True)


def main() -> None:
    """Print a row for each kind of clip."""
    first = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    compare_cuts(first)
    for overlay in MOVING:
        seeds = range(first, first + 5)
        clips = [Clip(road(seed), overlay(np.random.default_rng(seed))) for seed in seeds]
        compare(f"no vehicle: {overlay.__name__}", clips)
    drives = [Clip(road(first + n, speed=18.0 + 3 * n)) for n in range(5)]
    compare("no vehicle: driving", drives)
    for change in ("", "night", "fog", "drops"):
        driving = [Clip(traffic(first + n), change=change) for n in range(6)]
        compare(f"vehicles: {change or 'day'}", driving)
    compare("nothing moves", [Clip(road(first + n)) for n in range(10)])
    compare("all are tracked", [Clip(traffic(first + n), is_tracked=True) for n in range(20)])


if __name__ == "__main__":
    main()
