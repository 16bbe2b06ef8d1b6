"""How recall depends on visibility: `python -m benchmarks.visibility ROADS`, 2 minutes.

Some pictures of each set in ROADS are searched as frames of a video, as they are and changed. Two
logistic regressions tell from what one sees which fraction of the vehicles is found, and how likely
there are drops on the lens; their weights are written into `vdet.conditions`. What is printed for a
set is predicted by weights that are fitted to all other sets.

With `--networks` each picture is searched by the network of `make unseen` that was trained without
it. The shipped network has learnt the pictures, and finds more in them than elsewhere: without
`--networks`, `LEARNT` is subtracted.
"""

import argparse
import json
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from sklearn.linear_model import LogisticRegression

from benchmarks.conditions import CHANGES
from benchmarks.unseen import deal
from vdet.boxes import Float64Array, Int64Array
from vdet.conditions import visibility
from vdet.conditions.visibility import PLAIN, probability
from vdet.conditions.watch import planes_of
from vdet.config.kinds import NetworkSettings
from vdet.detect.detectors import DetectorModel, load_detector
from vdet.detect.onnx.detector import SHIPPED
from vdet.labels.images import LabelledImage
from vdet.labels.reading import read_labelled_images
from vdet.media import Picture

_WORK = Path("build/visibility")
LEARNT = 0.46
"""By how much the log odds to find a vehicle are higher in pictures that a network has learnt.

Measured with two networks: what the one that has learnt eleven sets gains in these over the other,
less what it gains in eleven sets that both have learnt (90 % of resamplings: 0.30 to 0.65).
"""
_TURNS = "drops", "night", "drops", "fog", "drops", "blur"
"""How pictures are changed, in turn."""
_CODES = {"night": "dark", "fog": "haze"}
"""The codes of changes that have another name."""
_VEHICLES = "car", "truck", "bus", "vehicle"
_SMALLEST = 0.025
"""Width of vehicles that are counted, as a fraction of the picture's."""
_SHOWN, _FOUND = 0.4, 0.45
"""Smallest score, and intersection over union, of a vehicle that was found."""


@dataclass(frozen=True, slots=True)
class Searched:
    """A picture of a set, as it is or changed: what one sees, the vehicles, and those found."""

    name: str
    change: str
    look: tuple[float, ...]
    vehicles: int
    found: int


def main() -> None:
    """Write the weights of `visibility`, and print what the other sets tell of each set."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("roads", type=Path, help="folder of sets of labelled pictures")
    help_ = "folder of make unseen: search each picture by a network that has not seen it"
    parser.add_argument("--networks", type=Path, help=help_)
    parser.add_argument("--number", type=int, default=24, help="of pictures of each set")
    options = parser.parse_args()
    networks = _of_folds(options.networks) if options.networks else [SHIPPED]
    searches = _searched(options.roads, networks, options.number)
    weights = {"recall": _fit_recall(searches), "drops": _fit_drops(searches)}
    if options.networks:
        of_shipped = _searched(options.roads, [SHIPPED], options.number)
        gain = _log_odds(of_shipped) - _log_odds(searches)
        print(f"the shipped network has log odds that are {gain:.2f} higher: LEARNT")
    else:
        weights["recall"][-1] -= LEARNT
        print("these are recalls of learnt pictures; those that are written are lower by LEARNT")
    text = json.dumps({name: np.round(values, 3).tolist() for name, values in weights.items()})
    Path(visibility.__file__).with_name("weights.json").write_text(f"{text}\n", encoding="utf-8")
    visibility.read_weights.cache_clear()
    recalls, drops = np.empty(len(searches)), np.empty(len(searches))
    names = np.array([item.name for item in searches])
    for name in np.unique(names):
        others = [item for item in searches if item.name != name]
        looks = _looks(searches)[names == name]
        recalls[names == name] = probability(_fit_recall(others), looks)
        drops[names == name] = probability(_fit_drops(others), looks[:, :PLAIN])
    print("\n".join((*_recall_lines(searches, recalls), "", *_drops_lines(searches, drops))))


def _of_folds(folder: Path) -> list[Path]:
    """Return the networks of all folds, with the calibration of their common results."""
    from benchmarks.ship import ship  # needs torch

    names = [f"without_{fold}.onnx" for fold in range(len(list(folder.glob("without_*.onnx"))))]
    if not names:
        raise SystemExit(f"{folder}: has no networks without_0.onnx, without_1.onnx, …")
    results = folder / "results.json"
    if not results.exists():
        print(f"{results}: not found; the networks have the usual calibration")
    _WORK.mkdir(parents=True, exist_ok=True)
    for name in names:
        ship(folder / name, results if results.exists() else None, _WORK / name)
    return [_WORK / name for name in names]


def _searched(roads: Path, networks: Sequence[Path], number: int) -> list[Searched]:
    """Search some pictures of all sets, each by the network of its fold."""
    models = [load_detector(NetworkSettings(model=str(network))) for network in networks]
    sets = [read_labelled_images(path) for path in sorted(roads.iterdir()) if path.is_dir()]
    searches: list[Searched] = []
    for labelled, folds in zip(sets, deal(sets, len(networks)), strict=True):
        name, images = Path(labelled.name).name, labelled.images
        spread = np.linspace(0, len(images) - 1, min(len(images), number)).astype(int)
        for turn, chosen in enumerate(spread.tolist()):
            searches += _both(name, images[chosen], turn, models[folds[chosen]])
        print(f"{name}: searched", flush=True)
    return searches


def _both(
    name: str, labelled: LabelledImage, turn: int, model: DetectorModel
) -> Iterator[Searched]:
    """Yield the picture as it is and changed, if it has vehicles."""
    image = labelled.read()
    truth = [
        label.box
        for label in labelled.labels
        if label.class_name in _VEHICLES
        and not label.ignored
        and label.box.width >= _SMALLEST * image.shape[1]
    ]
    if not truth:
        return
    kind = _TURNS[turn % len(_TURNS)]
    changed = CHANGES[kind](image, np.random.default_rng(turn), 0.0)
    for change, shown in (("", image), (_CODES.get(kind, kind), changed)):
        picture = Picture(np.ascontiguousarray(shown))
        search = model.for_video(picture.width, picture.height, [shown])
        boxes = search.detect(search.search(picture, 0))
        sure = [item.box for item in boxes if item.score >= _SHOWN]
        found = sum(any(box.iou(other) >= _FOUND for other in sure) for box in truth)
        look = visibility.measure(*planes_of(picture), boxes.scores)
        yield Searched(name, change, tuple(look.tolist()), len(truth), found)


def _looks(searches: Sequence[Searched]) -> Float64Array:
    return np.array([item.look for item in searches])


def _weighted(searches: Sequence[Searched]) -> tuple[Float64Array, Float64Array]:
    """Return the vehicles that are found and missed; a picture of many counts like one of six."""
    every, found = np.array([(item.vehicles, item.found) for item in searches], np.float64).T
    usual = np.minimum(1, 6 / every)
    return found * usual, (every - found) * usual


def _log_odds(searches: Sequence[Searched]) -> float:
    """Return the log odds to find a vehicle in pictures as they are."""
    found, missed = _weighted([item for item in searches if not item.change])
    return float(np.log(found.sum() / missed.sum()))


def _fit_recall(searches: Sequence[Searched]) -> list[float]:
    """Return the weights of the fraction of vehicles that are found, and the bias."""
    looks, is_found = _looks(searches), np.repeat([1, 0], len(searches))
    return _fit(np.vstack([looks, looks]), is_found, np.concatenate(_weighted(searches)))


def _fit_drops(searches: Sequence[Searched]) -> list[float]:
    """Return the weights of drops on the lens, and the bias, where one sees well without."""
    sees_well = visibility.dim(_looks(searches), 1.2) == ""
    used = [n for n, item in enumerate(searches) if item.change in ("", "drops") and sees_well[n]]
    has_drops = np.array([searches[n].change == "drops" for n in used], int)
    balance = len(used) / np.bincount(has_drops)[has_drops]
    return _fit(_looks(searches)[used, :PLAIN], has_drops, balance)


def _fit(looks: Float64Array, is_so: Int64Array, counts: Float64Array) -> list[float]:
    model = LogisticRegression(C=10, max_iter=5000).fit(looks, is_so, sample_weight=counts)
    return [*map(float, model.coef_[0]), float(model.intercept_[0])]


def _recall_lines(searches: Sequence[Searched], recalls: Float64Array) -> list[str]:
    """Return the recall by visibility, of pictures as they are, and of drawn drops."""
    rows: dict[str, list[tuple[float, float, int]]] = defaultdict(list)
    codes = visibility.reasons(_looks(searches)).tolist()
    for item, recall, code in zip(searches, recalls.tolist(), codes, strict=True):
        if item.change == ("drops" if code == "drops" else ""):
            rows[code or "clear"].append((recall, item.found / item.vehicles, item.vehicles))
    lines = ["| visibility | images | vehicles | predicted, true (of images) | (of vehicles) |"]
    for name, values in sorted(rows.items()):
        predicted, true, number = np.array(values).T
        of_images = f"{predicted.mean():.2f}, {true.mean():.2f}"
        of_all = ", ".join(f"{np.average(part, weights=number):.2f}" for part in (predicted, true))
        lines.append(f"| {name} | {len(values)} | {number.sum():.0f} | {of_images} | {of_all} |")
    return lines


def _drops_lines(searches: Sequence[Searched], drops: Float64Array) -> list[str]:
    """Return how often drops are reported where it is not dark, hazy or blurred."""
    changes = np.array([item.change for item in searches])
    sees_well = visibility.dim(_looks(searches)) == ""
    lines = []
    for name, change in (("as they are", ""), ("with drops", "drops")):
        reported = drops[sees_well & (changes == change)] > visibility.LIKELY
        lines.append(f"drops in images {name}: {reported.sum()} of {len(reported)}")
    return lines


if __name__ == "__main__":
    main()
