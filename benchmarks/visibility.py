"""How recall depends on visibility: `python -m benchmarks.conditions pictures ROADS`.

Some pictures of each set in ROADS are searched as frames of a video, as they are and changed. Two
logistic regressions tell from what one sees which fraction of the vehicles is found, and how likely
there are drops on the lens; their weights are written into `vdet.conditions`. What is printed for a
set is predicted by weights that are fitted to all other sets.

With `--networks` each picture is searched by the network of `make unseen` that was trained without
it. The shipped network has learnt the pictures, and finds more in them than elsewhere: without
`--networks`, `LEARNT` is subtracted.

Searches are kept in `build/conditions`: a stopped run resumes there.
"""

import hashlib
import json
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from sklearn.linear_model import LogisticRegression

from benchmarks import conditions
from benchmarks.conditions import CHANGES
from benchmarks.unseen import deal
from vdet.boxes import Float64Array, Int64Array
from vdet.conditions import visibility
from vdet.conditions.visibility import PLAIN, probability
from vdet.conditions.watch import planes_of
from vdet.config.loading import load_settings
from vdet.detect.detectors import DetectorModel, load_detector
from vdet.detect.onnx.detector import SHIPPED
from vdet.evaluate.report import table
from vdet.files import json_text, write_whole
from vdet.labels.images import LabelledImage
from vdet.labels.reading import read_labelled_images
from vdet.media import Picture

_WORK = Path("build/conditions")
LEARNT = 0.46
"""By how much the log odds to find a vehicle are higher in pictures that a network has learnt.

Measured with two networks: what the one that has learnt eleven sets gains in these over the other,
less what it gains in eleven sets that both have learnt (90 % of resamplings: 0.30 to 0.65).
"""
_SECONDS = 0.1
"""Of processor time that a search takes, about."""
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


Searches = Sequence[Searched]


def measure_pictures(roads: Path, folder: Path | None, number: int) -> None:
    """Write the weights of `visibility`, and print what the other sets tell of each set.

    `folder` has the networks and results of `make unseen`; so many pictures of a set are searched.
    """
    searches = _searched(roads, _of_folds(folder) if folder else [SHIPPED], number)
    weights = {"recall": _fit_recall(searches), "drops": _fit_drops(searches)}
    if folder:
        gain = _log_odds(_searched(roads, [SHIPPED], number)) - _log_odds(searches)
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
    files = *networks, Path(visibility.__file__), Path(__file__), Path(conditions.__file__)
    digest = hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()
    work = _WORK / f"{digest[:12]}_{number}"
    work.mkdir(parents=True, exist_ok=True)
    settings = load_settings().detector
    models = [
        load_detector(settings.model_copy(update={"model": str(network)})) for network in networks
    ]
    sets = [read_labelled_images(path) for path in sorted(roads.iterdir()) if path.is_dir()]
    chosen = [_spread(len(labelled.images), number) for labelled in sets]
    left = 2 * sum(map(len, chosen))
    print(f"{left // 2} pictures, each as it is and changed: {_minutes(left)}", flush=True)
    searches = []
    for labelled, numbers, folds in zip(sets, chosen, deal(sets, len(networks)), strict=True):
        path = work / f"{Path(labelled.name).name}.json"
        if not path.exists():
            found = [
                item
                for turn, number in enumerate(numbers)
                for item in _both(path.stem, labelled.images[number], turn, models[folds[number]])
            ]
            write_whole(path, json_text([asdict(item) for item in found]), overwrite=True)
        left -= 2 * len(numbers)
        print(f"{path.stem}: searched; {_minutes(left)} left", flush=True)
        rows = json.loads(path.read_text(encoding="utf-8"))
        searches += [Searched(**row) for row in rows]
    return searches


def _spread(every: int, number: int) -> Int64Array:
    """Return the indices of a number of all pictures, evenly spread."""
    return np.linspace(0, every - 1, min(every, number)).astype(np.int64)


def _minutes(searches: int) -> str:
    return f"about {searches * _SECONDS / 60:.1f} minutes"


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


def _looks(searches: Searches) -> Float64Array:
    return np.array([item.look for item in searches])


def _weighted(searches: Searches) -> tuple[Float64Array, Float64Array]:
    """Return the vehicles that are found and missed; a picture of many counts like one of six."""
    every, found = np.array([(item.vehicles, item.found) for item in searches], np.float64).T
    usual = np.minimum(1, 6 / every)
    return found * usual, (every - found) * usual


def _log_odds(searches: Searches) -> float:
    """Return the log odds to find a vehicle in pictures as they are."""
    found, missed = _weighted([item for item in searches if not item.change])
    return float(np.log(found.sum() / missed.sum()))


def _fit_recall(searches: Searches) -> list[float]:
    """Return the weights of the fraction of vehicles that are found, and the bias."""
    looks, is_found = _looks(searches), np.repeat([1, 0], len(searches))
    return _fit(np.vstack([looks, looks]), is_found, np.concatenate(_weighted(searches)))


def _fit_drops(searches: Searches) -> list[float]:
    """Return the weights of drops on the lens, and the bias, where one sees well without."""
    sees_well = visibility.dim(_looks(searches), 1.2) == ""
    used = [n for n, item in enumerate(searches) if item.change in ("", "drops") and sees_well[n]]
    has_drops = np.array([searches[n].change == "drops" for n in used], int)
    balance = len(used) / np.bincount(has_drops)[has_drops]
    return _fit(_looks(searches)[used, :PLAIN], has_drops, balance)


def _fit(looks: Float64Array, is_so: Int64Array, counts: Float64Array) -> list[float]:
    model = LogisticRegression(C=10, max_iter=5000).fit(looks, is_so, sample_weight=counts)
    return [*map(float, model.coef_[0]), float(model.intercept_[0])]


def _recall_lines(searches: Searches, recalls: Float64Array) -> list[str]:
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


def _drops_lines(searches: Searches, drops: Float64Array) -> list[str]:
    """Return how often drops are reported in each set, where it is not dark, hazy or blurred."""
    reported: dict[str, dict[str, list[bool]]] = defaultdict(lambda: {"": [], "drops": []})
    sees_well = visibility.dim(_looks(searches)) == ""
    for item, chance, is_used in zip(searches, drops.tolist(), sees_well, strict=True):
        if item.change in ("", "drops") and is_used:
            for name in ("all sets", item.name):
                reported[name][item.change].append(chance > visibility.LIKELY)
    rows = [
        [name, *(f"{sum(own)} of {len(own)}" for own in by_change.values())]
        for name, by_change in reported.items()
    ]
    return table(("drops in", "as it is", "with drops"), rows)
