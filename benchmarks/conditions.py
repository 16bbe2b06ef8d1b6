"""Are findings right when the conditions change? `python -m benchmarks.conditions`: 3 minutes.

A drawn road is seen from a pole. After `CHANGE` seconds the camera shakes or is bumped, it becomes
dark, foggy or blurred, or some vehicles are hidden from the tracker; the others have true boxes.
"""

import argparse
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np

from benchmarks.drawn_traffic import true_tracks
from vdet.boxes import Boxes, Image
from vdet.conditions.watch import Conditions
from vdet.config.scene import LineSettings, TrafficSettings
from vdet.config.schema import Settings
from vdet.findings import Findings
from vdet.labels.label import boxes_of
from vdet.media import Picture
from vdet.synthetic import Renderer, Scene, pole_scene, true_boxes

CHANGE = 4.0
"""Seconds after which the conditions change."""
EXPECTED = {
    "unchanged": None,
    "shaken": "camera-moves",
    "bumped": "camera-moved",
    "night": "dark",
    "fog": "haze",
    "blur": "blur",
    "hidden": "unexplained-motion",
}
"""The code of the right finding, by what changes."""
SETTINGS = Settings(
    traffic=TrafficSettings(lines=(LineSettings(name="gate", start=(0.1, 0.5), end=(0.9, 0.5)),))
)
_LATE = 1.0
"""Largest difference of the start of a right finding from that of the change, seconds."""
_HIDDEN = 3
"""Every vehicle of this number is hidden from the tracker."""
_LARGE = 0.002
"""Area from which a hidden vehicle should be noticed, as a fraction of the frame's."""
Change = Callable[[Image, np.random.Generator, float], Image]
"""Changes an image: how much is random, the last argument is the time in seconds."""


def _moved(image: Image, x: float, y: float, degrees: float) -> Image:
    """Move an image by fractions of its width, and turn it."""
    height, width = image.shape[:2]
    matrix = cv2.getRotationMatrix2D((width / 2, height / 2), degrees, 1)
    matrix[:, 2] += x * width, y * width
    border = cv2.BORDER_REFLECT
    return np.asarray(cv2.warpAffine(image, matrix, (width, height), borderMode=border))


def _shaken(image: Image, rng: np.random.Generator, time: float) -> Image:
    far = rng.uniform(0.02, 0.05)
    x, y, around = np.sin(np.array((5.0, 6.3, 7.0)) * time + rng.uniform(0, 2 * np.pi, 3))
    return _moved(image, far * x, far * y, 0.6 * around)


def _bumped(image: Image, rng: np.random.Generator, _: float) -> Image:
    far, angle = rng.uniform(0.02, 0.05), rng.uniform(0, 2 * np.pi)
    return _moved(image, far * np.cos(angle), far * np.sin(angle), rng.uniform(-2, 2))


def _night(image: Image, rng: np.random.Generator, _: float) -> Image:
    gain, gamma = rng.uniform(0.15, 0.35), rng.uniform(1.3, 2.0)
    return np.asarray((image / 255) ** gamma * gain * 255, np.uint8)


def _fog(image: Image, rng: np.random.Generator, _: float) -> Image:
    """Soften an image and blend it with grey: all that is far, and less of what is near."""
    grey, veil = rng.uniform(150, 210), rng.uniform(0.7, 0.9)
    soft = cv2.GaussianBlur(image, (0, 0), 0.002 * image.shape[1])
    part = veil * np.linspace(1.1, 0.9, len(image))[:, np.newaxis, np.newaxis]
    return np.asarray(soft * (1 - part) + grey * part, np.uint8)


def _blur(image: Image, rng: np.random.Generator, _: float) -> Image:
    sigma = rng.uniform(0.005, 0.008) * image.shape[1]
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma))


def _drops(image: Image, rng: np.random.Generator, _: float) -> Image:
    """Draw drops on the lens: each shows all that is behind it, small and upside down."""
    height, width = image.shape[:2]
    veil, far, largest = rng.uniform(0, 0.3), rng.uniform(0.0006, 0.003), rng.uniform(0.006, 0.03)
    behind = cv2.GaussianBlur(image, (0, 0), far * width) * (1 - veil) + veil * 1.4 * image.mean()
    y, x = np.mgrid[:height, :width].astype(np.float32)
    from_x, from_y, shade, alpha = x.copy(), y.copy(), np.ones_like(x), np.zeros_like(x)
    for _number in range(int(60 * 25 ** rng.random())):
        radius, zoom = width * (0.002 + largest * rng.random() ** 3), rng.uniform(4, 12)
        tall = radius * rng.uniform(0.9, 1.6)
        x0, y0 = rng.uniform(0, width), rng.uniform(0, height)
        part = np.s_[
            max(0, int(y0 - tall)) : int(y0 + tall) + 2,
            max(0, int(x0 - radius)) : int(x0 + radius) + 2,
        ]
        off = ((x[part] - x0) / radius) ** 2 + ((y[part] - y0) / tall) ** 2
        inside = off < 1
        from_x[part][inside] = (x0 - (x[part] - x0) * zoom)[inside]
        from_y[part][inside] = (y0 - (y[part] - y0) * zoom)[inside]
        shade[part][inside] = (1.15 - 0.6 * off**2)[inside]
        alpha[part] = np.maximum(alpha[part], np.clip(1.5 * (1 - off), 0, 1))
    soft = cv2.GaussianBlur(image, (0, 0), 0.006 * width)
    border = cv2.BORDER_REFLECT
    small = cv2.remap(soft, from_x, from_y, cv2.INTER_LINEAR, borderMode=border)
    alpha = cv2.GaussianBlur(alpha, (0, 0), 0.6)[..., np.newaxis]
    shown = behind * (1 - alpha) + small * shade[..., np.newaxis] * alpha
    return np.asarray(np.clip(shown, 0, 255), np.uint8)


CHANGES: dict[str, Change] = {
    "shaken": _shaken,
    "bumped": _bumped,
    "night": _night,
    "fog": _fog,
    "blur": _blur,
    "drops": _drops,
}


@dataclass(frozen=True)
class Road:
    """A drawn road from a pole, and its images by frame."""

    scene: Scene
    images: dict[int, Image]

    @classmethod
    def drawn(cls, seed: int) -> "Road":
        """Draw every third frame of a random road."""
        scene = replace(pole_scene(seed), frames=125)
        renderer = Renderer(scene)
        return cls(scene, {n: renderer.image(n) for n in range(0, scene.frames, 3)})

    def watched(self, kind: str) -> Conditions:
        """Return what watched the road where it is changed in this way."""
        conditions = Conditions(SETTINGS, self.scene.camera.width)
        for index, drawn in self.images.items():
            image, time = drawn, self.scene.time(index)
            tracks = true_tracks(self.scene, index)
            if kind == "hidden":
                tracks = tuple(track for track in tracks if track.id % _HIDDEN)
            if kind in CHANGES and time >= CHANGE:
                image = CHANGES[kind](drawn, np.random.default_rng(self.scene.seed), time)
            boxes = Boxes(boxes_of(tracks), np.full(len(tracks), 0.9))
            conditions.add(time, Picture(image), boxes, tracks)
        return conditions

    def is_right(self, kind: str, findings: Findings) -> bool:
        """Return whether the right finding is there in time; without a change, none."""
        starts = {item.code: item.spans[0][0] for item in findings.items}
        expected = EXPECTED[kind]
        if expected is None or expected not in starts:
            return expected is None and not starts
        return abs(starts[expected] - (self._appears if kind == "hidden" else CHANGE)) <= _LATE

    @property
    def _appears(self) -> float:
        """When a vehicle that can be hidden is first large, seconds."""
        frame = self.scene.camera.width * self.scene.camera.height
        return next(
            self.scene.time(index)
            for index in self.images
            for item in true_boxes(self.scene, index)
            if item.id % _HIDDEN == 0 and item.box.area > _LARGE * frame
        )


def main() -> None:
    """Print how often the right finding was there, by what changed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, nargs="+", default=range(12), help="of drawn roads")
    seeds = parser.parse_args().seeds
    right = Counter[str]()
    for seed in seeds:
        road = Road.drawn(seed)
        results = {kind: road.is_right(kind, road.watched(kind).findings()) for kind in EXPECTED}
        wrong = [kind for kind, is_right in results.items() if not is_right]
        print(f"road {seed}: wrong: {', '.join(wrong) or 'none'}", flush=True)
        right.update(kind for kind, is_right in results.items() if is_right)
    for kind in EXPECTED:
        print(f"{kind:10} {right[kind]} of {len(seeds)}")


if __name__ == "__main__":
    main()
