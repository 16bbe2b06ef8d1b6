"""What makes results doubtful: are the findings right, and what is found in which sight?

    python -m benchmarks.conditions                 # drawn roads that change after some seconds
    python -m benchmarks.conditions pictures ROADS  # labelled pictures: the weights of `visibility`

A drawn road is seen from a pole. After `CHANGE` seconds the camera shakes or is bumped, it becomes
dark, foggy or blurred, or some vehicles are hidden from the tracker; the others have true boxes.
"""

import sys
from collections.abc import Callable, Iterator
from dataclasses import astuple, replace
from pathlib import Path

import cv2
import numpy as np
from sklearn.linear_model import LogisticRegression

from vdet.boxes import Box, Boxes, Float64Array, Image
from vdet.conditions.finding import Finding
from vdet.conditions.visibility import Sight
from vdet.conditions.watch import Conditions, small_luma
from vdet.config.loading import load_settings
from vdet.config.places import LineSettings, TrafficSettings
from vdet.config.schema import Settings
from vdet.detect.factory import load_detector
from vdet.detect.onnx.detector import SHIPPED, trained_on
from vdet.labels.reading import read_labelled_pictures
from vdet.media import Picture
from vdet.media.images import read_image
from vdet.run.pictures import PictureSearch
from vdet.synthetic.random_scenes import pole_scene
from vdet.synthetic.render import Renderer
from vdet.synthetic.scene import Scene
from vdet.synthetic.truth import true_boxes
from vdet.track.track import Track

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
_SEEDS = 12
_SMALLEST = 0.025
"""Width of vehicles that are counted in pictures, as a fraction of the picture's."""
_FOUND = 0.45
"""Least intersection over union of a vehicle that was found."""
_MOST = 150
"""Pictures of a set that are searched."""


class Changed:
    """A drawn road, and how it is changed."""

    def __init__(self, scene: Scene, seed: int) -> None:
        self.scene = scene
        self.images = {n: Renderer(scene).image(n) for n in range(0, scene.frames, 3)}
        self.seed = seed

    def findings(self, kind: str) -> tuple[Finding, ...]:
        """Return what is found where the road is changed in this way."""
        rng = np.random.default_rng([self.seed, sorted(EXPECTED).index(kind)])
        change = _change(kind, rng)
        conditions = Conditions(SETTINGS, self.scene.camera.width)
        for index, image in self.images.items():
            time = self.scene.time(index)
            boxes = [(true_box.id, true_box.box) for true_box in true_boxes(self.scene, index)]
            if kind == "hidden":
                boxes = [(number, box) for number, box in boxes if number % 3]
            shown = change(image, time) if time >= CHANGE else image
            tracks = [Track(number, box, 0.9, "detected") for number, box in boxes]
            sides = [(box.x1, box.y1, box.x2, box.y2) for _, box in boxes]
            found = Boxes(sides, np.full(len(sides), 0.9))
            conditions.add(time, Picture(shown), found, tracks)
        return conditions.findings()

    def is_right(self, kind: str) -> bool:
        """Return whether the right finding, and no other warning, is there in time."""
        codes = {finding.code: finding for finding in self.findings(kind)}
        expected = EXPECTED[kind]
        if expected is None:
            return not codes
        if expected not in codes:
            return False
        start = codes[expected].spans[0][0]
        return kind == "hidden" or abs(start - CHANGE) <= _LATE


def drawn_road(seed: int) -> Changed:
    """Return a road from a pole that can be changed."""
    return Changed(replace(pole_scene(seed), frames=125), seed)


def _change(kind: str, rng: np.random.Generator) -> Callable[[Image, float], Image]:
    """Return a function that changes an image at a time."""
    grey, veil = rng.uniform(150, 210), rng.uniform(0.7, 0.9)
    gain, gamma = rng.uniform(0.15, 0.35), rng.uniform(1.3, 2.0)
    sigma = rng.uniform(6, 10)
    far, phase, turn = rng.uniform(0.02, 0.05), rng.uniform(0, 2 * np.pi, 3), rng.uniform(-2, 2)

    def moved(image: Image, x: float, y: float, degrees: float) -> Image:
        height, width = image.shape[:2]
        matrix = cv2.getRotationMatrix2D((width / 2, height / 2), degrees, 1)
        matrix[:, 2] += x * width, y * width
        border = cv2.BORDER_REFLECT
        return np.asarray(cv2.warpAffine(image, matrix, (width, height), borderMode=border))

    def shaken(image: Image, time: float) -> Image:
        x, y, around = np.sin(np.array((5.0, 6.3, 7.0)) * time + phase)
        return moved(image, far * x, far * y, 0.6 * around)

    def bumped(image: Image, _: float) -> Image:
        return moved(image, far * np.cos(phase[0]), far * np.sin(phase[0]), turn)

    changes: dict[str, Callable[[Image, float], Image]] = {
        "shaken": shaken,
        "bumped": bumped,
        "night": lambda image, _: np.asarray((image / 255) ** gamma * gain * 255, np.uint8),
        "fog": lambda image, _: np.asarray(image * (1 - veil) + grey * veil, np.uint8),
        "blur": lambda image, _: np.asarray(cv2.GaussianBlur(image, (0, 0), sigma)),
    }
    return changes.get(kind, lambda image, _: image)


def compare_drawn() -> None:
    """Print how often the right finding was there, by what changed."""
    right = dict.fromkeys(EXPECTED, 0)
    for seed in range(_SEEDS):
        road = drawn_road(seed)
        for kind in EXPECTED:
            right[kind] += road.is_right(kind)
    for kind, count in right.items():
        print(f"{kind:10} {count} of {_SEEDS}")


def measure_pictures(roads: Path) -> None:
    """Print the recall by sight in sets that the network has not seen, and the weights.

    Each of these sets is predicted from all others, and from the sets that the network has seen:
    as they are, and in the dark, in fog and blurred. What it has seen has an offset of its own.
    """
    settings = load_settings(assignments=["detector.min_score_still=0.1"])
    search = PictureSearch(load_detector(settings.detector), settings)
    seen = trained_on(SHIPPED)
    rows = []
    for path in sorted(item for item in roads.iterdir() if item.is_dir()):
        rows += [(path.name, *row) for row in _measured(path, search, altered=path.name in seen)]
    names = np.array([row[0] for row in rows])
    is_seen = np.isin(names, seen)
    counts = np.array([row[2:] for row in rows], np.float64)
    features = np.array([_features(row[1]) for row in rows])
    features = np.column_stack([features, is_seen])
    predicted = np.zeros(len(rows))
    for name in set(names[~is_seen]):
        model = _fit(features[names != name], counts[names != name])
        predicted[names == name] = model.predict_proba(features[names == name])[:, 1]
    codes = np.array([row[1].code or "clear" for row in rows])
    for code in sorted(set(codes)):
        rows_of = (codes == code) & ~is_seen
        every, found = counts[rows_of].T
        reported = predicted[rows_of]
        print(
            f"{code}: {len(every)} pictures, {every.sum():.0f} vehicles; by picture: reported "
            f"{reported.mean():.2f}, true {np.mean(found / every):.2f}; by vehicle: reported "
            f"{(reported * every).sum() / every.sum():.2f}, true {found.sum() / every.sum():.2f}"
        )
    whole = _fit(features, counts)
    print("weights", whole.coef_[0][:-1].round(2).tolist(), "bias", whole.intercept_.round(2))


def _features(sight: Sight) -> Float64Array:
    brightness, contrast, sharpness, weak, sure = astuple(sight)
    seen = np.log(np.maximum((brightness + 5, contrast, sharpness), 0.05))
    return np.array([*seen, weak, sure])


def _fit(features: Float64Array, counts: Float64Array) -> LogisticRegression:
    """Fit the fraction of vehicles that are found; `counts` are all, and those found."""
    every, found = counts.T
    usual = np.minimum(1, 6 / every)  # a picture full of vehicles does not outweigh the others
    weights = np.concatenate([found * usual, (every - found) * usual])
    labels = np.repeat([1, 0], len(every))
    model = LogisticRegression(C=10, max_iter=2000)
    return model.fit(np.vstack([features, features]), labels, sample_weight=weights)


def _measured(
    path: Path, search: PictureSearch, *, altered: bool
) -> Iterator[tuple[Sight, int, int]]:
    """Yield the sight of each picture of a set with vehicles, their number, and how many found.

    With `altered`, each is measured a second time, changed: dark, foggy and blurred in turn.
    """
    pictures = read_labelled_pictures(path).pictures
    for number, labelled in enumerate(pictures[:: max(1, len(pictures) // _MOST)]):
        image = read_image(labelled.path)
        truth = [
            Box(*label.box)
            for label in labelled.labels
            if label.name in ("car", "truck", "bus", "vehicle")
            and not label.ignored
            and label.box[2] - label.box[0] >= _SMALLEST * image.shape[1]
        ]
        if not truth:
            continue
        kind = ("night", "fog", "blur")[number % 3]
        change = _change(kind, np.random.default_rng(number))
        for shown in (image, change(image, 0.0))[: 1 + altered]:
            found = search.detect(labelled.path, shown).detections
            scores = np.array([item.score for item in found], np.float64)
            sure = [item.box for item in found if item.score >= 0.4]
            hits = sum(any(_iou(box, other) >= _FOUND for other in sure) for box in truth)
            yield Sight.of(small_luma(Picture(shown)), scores), len(truth), hits


def _iou(box: Box, other: Box) -> float:
    common = box.intersection(other).area
    return common / (box.area + other.area - common)


if __name__ == "__main__":
    if sys.argv[1:2] == ["pictures"]:
        measure_pictures(Path(sys.argv[2]))
    else:
        compare_drawn()
