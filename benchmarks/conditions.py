"""What makes results doubtful: are the findings right, and what is found in which sight?

    python -m benchmarks.conditions                 # drawn roads that change after some seconds
    python -m benchmarks.conditions pictures ROADS  # labelled pictures: the weights of `visibility`

A drawn road is seen from a pole. After `CHANGE` seconds the camera shakes or is bumped, it becomes
dark, foggy or blurred, or some vehicles are hidden from the tracker; the others have true boxes.
"""

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from sklearn.linear_model import LogisticRegression

from vdet.boxes import Box, Boxes, Float64Array, Image, Int64Array
from vdet.conditions import visibility
from vdet.conditions.finding import Finding
from vdet.conditions.visibility import Sight
from vdet.conditions.watch import Conditions, halved, small_luma
from vdet.config.loading import load_settings
from vdet.config.places import LineSettings, TrafficSettings
from vdet.config.schema import Settings
from vdet.detect.factory import load_detector
from vdet.detect.onnx.detector import SHIPPED, trained_on
from vdet.detect.protocol import DetectorModel
from vdet.labels.reading import read_labelled_pictures
from vdet.media import Picture
from vdet.media.images import read_image
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
_MOST = {True: 16, False: 32}
"""Pictures of a set that are searched: of one that the network has learnt, and of others."""
_CHANGES = "drops", "night", "drops", "fog", "drops", "blur"
"""How pictures are changed in turn; other sets than those learnt show real dark, fog and blur."""
_LEARNT = 0.5
"""By how much the logarithm of the odds to find a vehicle is higher in sets that a network has
learnt, where there are no others to measure it by."""


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
    sigma, seed = rng.uniform(0.005, 0.008), int(rng.integers(1000))
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
        "fog": lambda image, _: _in_fog(image, grey, veil),
        "blur": lambda image, _: np.asarray(
            cv2.GaussianBlur(image, (0, 0), sigma * image.shape[1])
        ),
        "drops": lambda image, _: with_drops(image, seed),
    }
    return changes.get(kind, lambda image, _: image)


def _in_fog(image: Image, grey: float, veil: float) -> Image:
    """Soften an image and blend it with grey: all that is far, and less of what is near."""
    soft = cv2.GaussianBlur(image, (0, 0), 0.002 * image.shape[1])
    part = veil * np.linspace(1.1, 0.9, len(image))[:, np.newaxis, np.newaxis]
    return np.asarray(soft * (1 - part) + grey * part, np.uint8)


def with_drops(image: Image, seed: int) -> Image:
    """Draw drops on the lens: each shows all that is behind it, small and upside down."""
    rng = np.random.default_rng(seed)
    height, width = image.shape[:2]
    veil, far, largest = rng.uniform(0, 0.3), rng.uniform(0.0006, 0.003), rng.uniform(0.006, 0.03)
    behind = cv2.GaussianBlur(image, (0, 0), far * width) * (1 - veil) + veil * 1.4 * image.mean()
    y, x = np.mgrid[:height, :width].astype(np.float32)
    from_x, from_y, shade, alpha = x.copy(), y.copy(), np.ones_like(x), np.zeros_like(x)
    for _ in range(int(60 * 25 ** rng.random())):
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


def compare_drawn() -> None:
    """Print how often the right finding was there, by what changed."""
    right = dict.fromkeys(EXPECTED, 0)
    for seed in range(_SEEDS):
        road = drawn_road(seed)
        for kind in EXPECTED:
            right[kind] += road.is_right(kind)
    for kind, count in right.items():
        print(f"{kind:10} {count} of {_SEEDS}")


@dataclass(frozen=True, slots=True)
class Look:
    """A picture of a set, as it is or changed: what one sees, the vehicles, and those found."""

    name: str
    is_seen: bool
    change: str
    sight: Sight
    vehicles: int
    found: int

    @property
    def values(self) -> tuple[float, ...]:
        """What the recall depends on."""
        return *self.sight.looks, self.sight.weak, self.sight.sure


def measure_pictures(roads: Path) -> None:
    """Write the weights of `visibility`, and print what the other sets tell of each set.

    Pictures are searched as frames of a video, as they are and changed: see `_CHANGES`.
    """
    settings = load_settings().detector
    model, seen = load_detector(settings), trained_on(SHIPPED)
    sets = sorted(item for item in roads.iterdir() if item.is_dir())
    looks = [look for path in sets for look in _measured(path, model, is_seen=path.name in seen)]
    weights = {"recall": _fit_recall(looks), "drops": _fit_drops(looks)}
    text = json.dumps({name: values.round(3).tolist() for name, values in weights.items()})
    Path(visibility.__file__).with_name("weights.json").write_text(f"{text}\n", encoding="utf-8")
    visibility.read_weights.cache_clear()
    recalls, drops = [], []
    for path in sets:
        own = [look for look in looks if look.name == path.name]
        others = [look for look in looks if look.name != path.name]
        by_recall, by_drops = _fit_recall(others), _fit_drops(others)
        recalls += [_probability(by_recall, look.values) for look in own]
        drops += [_probability(by_drops, look.sight.looks) for look in own]
    _print_recall(looks, recalls)
    _print_drops(looks, drops)


def _print_recall(looks: Sequence[Look], recalls: Sequence[float]) -> None:
    """Print the recall by sight, of sets that the network has not learnt if there are any."""
    has_new = not all(look.is_seen for look in looks)
    codes = [look.sight.code or "clear" for look in looks]
    for code in sorted(set(codes)):
        rows = [
            (recall, look.found / look.vehicles, look.vehicles)
            for look, recall, own in zip(looks, recalls, codes, strict=True)
            if own == code and not (has_new and look.is_seen) and look.change in ("", code)
        ]
        if rows:
            reported, true, number = np.array(rows).T
            of_all = np.average(reported, weights=number), np.average(true, weights=number)
            print(
                f"{code}: {len(rows)} pictures, {number.sum():.0f} vehicles; by picture: reported "
                f"{reported.mean():.2f}, true {true.mean():.2f}; by vehicle: reported "
                f"{of_all[0]:.2f}, true {of_all[1]:.2f}"
            )


def _print_drops(looks: Sequence[Look], drops: Sequence[float]) -> None:
    """Print how often drops are reported in each set, where it is not dark, hazy or blurred."""
    reported: dict[tuple[str, str], list[bool]] = {}
    for look, chance in zip(looks, drops, strict=True):
        if look.change in ("", "drops") and look.sight.dim() is None:
            is_reported = chance > visibility.LIKELY
            for name in (look.name, "all sets"):
                reported.setdefault((name, look.change), []).append(is_reported)
    for name in dict.fromkeys(name for name, _ in reported):
        without, drawn = reported.get((name, ""), []), reported.get((name, "drops"), [])
        print(
            f"{name}: drops in {sum(without)} of {len(without)}, drawn {sum(drawn)} of {len(drawn)}"
        )


def _fit_recall(looks: Sequence[Look]) -> Float64Array:
    """Return the weights of the fraction of vehicles that are found, and the bias.

    What the network has learnt has an offset of its own.
    """
    values = np.array([(*look.values, look.is_seen) for look in looks], np.float64)
    every, found = np.array([(look.vehicles, look.found) for look in looks], np.float64).T
    usual = np.minimum(1, 6 / every)  # a picture full of vehicles does not outweigh the others
    labels = np.repeat([1, 0], len(every))
    shares = np.concatenate([found * usual, (every - found) * usual])
    *weights, learnt, bias = _fit(np.vstack([values, values]), labels, shares)
    if values[:, -1].all():  # nothing tells how much less is found elsewhere
        bias += learnt - _LEARNT
    return np.array([*weights, bias])


def _fit_drops(looks: Sequence[Look]) -> Float64Array:
    """Return the weights of drops on the lens, and the bias, where one sees well without."""
    used = [look for look in looks if look.change in ("", "drops") and look.sight.dim(1.2) is None]
    values = np.array([look.sight.looks for look in used])
    labels = np.array([look.change == "drops" for look in used], int)
    number = np.bincount(labels)
    return _fit(values, labels, 1 / number[labels] * len(labels))


def _fit(values: Float64Array, labels: Int64Array, shares: Float64Array) -> Float64Array:
    model = LogisticRegression(C=10, max_iter=5000).fit(values, labels, sample_weight=shares)
    return np.array([*model.coef_[0], model.intercept_[0]])


def _probability(weights: Float64Array, values: Sequence[float]) -> float:
    return float(1 / (1 + np.exp(-np.dot(weights, (*values, 1.0)))))


def _measured(path: Path, model: DetectorModel, *, is_seen: bool) -> Iterator[Look]:
    """Yield each picture of a set that has vehicles, and the same changed."""
    pictures = read_labelled_pictures(path).pictures
    for number, labelled in enumerate(pictures[:: max(1, len(pictures) // _MOST[is_seen])]):
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
        change = _CHANGES[number % len(_CHANGES)]
        for how in ("", change) if is_seen or change == "drops" else ("",):
            shown = _change(how, np.random.default_rng(number))(image, 0.0)
            picture = Picture(np.ascontiguousarray(shown))
            search = model.for_video(picture.width, picture.height, [shown])
            boxes = search.detect(search.search(picture, 0))
            scores = np.array([item.score for item in boxes], np.float64)
            sure = [item.box for item in boxes if item.score >= 0.4]
            hits = sum(any(_iou(box, other) >= _FOUND for other in sure) for box in truth)
            plane = small_luma(picture)
            sight = Sight.of(plane, halved(plane), scores)
            code = {"night": "dark", "fog": "haze"}.get(how, how)
            yield Look(path.name, is_seen, code, sight, len(truth), hits)


def _iou(box: Box, other: Box) -> float:
    common = box.intersection(other).area
    return common / (box.area + other.area - common)


if __name__ == "__main__":
    if sys.argv[1:2] == ["pictures"]:
        measure_pictures(Path(sys.argv[2]))
    else:
        compare_drawn()
