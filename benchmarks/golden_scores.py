"""Makes the stored cases: scenes, and what trackeval and pycocotools say of them.

They need an environment of their own (trackeval wants the GUI OpenCV and an old NumPy):

    python3 -m venv golden && golden/bin/pip install "numpy<2" trackeval==1.0.0 pycocotools==2.0.11
    golden/bin/python benchmarks/golden_scores.py

The scenes go through trackeval's KITTI reader and preprocessing, with ignore regions as DontCare,
and through pycocotools with ignore regions as crowds. Boxes are higher than the 25 pixels that
KITTI asks for. No ignore region overlaps a vehicle, and predictions lie in one almost wholly or
hardly at all: else COCO's rule, whose limit is the IoU threshold, would differ above 0.5.
"""

import contextlib
import io
import json
import tempfile
from collections.abc import Callable
from importlib.metadata import version
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

Row = list[float]  # frame from 1, id, x, y, width, height, then score or ignored (0 or 1)
Scene = tuple[list[Row], list[Row]]  # truth, prediction

TRACKEVAL = {
    "matches": "CLR_TP", "false_positives": "CLR_FP", "misses": "CLR_FN",
    "precision": "CLR_Pr", "recall": "CLR_Re", "f1": "CLR_F1", "mota": "MOTA", "mean_iou": "MOTP",
    "id_switches": "IDSW", "fragmentations": "Frag",
    "idf1": "IDF1", "hota": "HOTA", "deta": "DetA", "assa": "AssA",
}  # fmt: skip
"""Our names of metrics, and those of trackeval; a metric with several thresholds is their mean."""

FRAMES = 24
HERE = Path(__file__).parents[1] / "tests" / "evaluate" / "golden"


def drive(vehicle: int, frames: range, x: float, y: float, step: float) -> list[Row]:
    """Return a vehicle of 90 × 60 pixels that moves `step` pixels a frame to the right."""
    return [[frame, vehicle, x + step * frame, y, 90, 60, 0] for frame in frames]


def seen(rows: list[Row], track: int | None = None, score: float = 1.0) -> list[Row]:
    """Return predictions that lie on `rows`, under another id where one is given."""
    return [[*row[:1], row[1] if track is None else track, *row[2:6], score] for row in rows]


def two_vehicles() -> tuple[list[Row], list[Row]]:
    every = range(1, FRAMES + 1)
    return drive(1, every, 100, 200, 4), drive(2, every, 500, 220, -3)


def perfect() -> Scene:
    truth = list(chain(*two_vehicles()))
    return truth, seen(truth)


def empty_prediction() -> Scene:
    return list(chain(*two_vehicles())), []


def empty_truth() -> Scene:
    return [], seen(list(chain(*two_vehicles())))


def one_swap() -> Scene:
    a, b = two_vehicles()
    half = FRAMES // 2
    swapped = [seen(a[:half], 1), seen(b[:half], 2), seen(a[half:], 2), seen(b[half:], 1)]
    return a + b, list(chain(*swapped))


def one_split() -> Scene:
    a, b = two_vehicles()
    return a + b, seen(a[:9], 1) + seen(a[9:], 3) + seen(b, 2)


def gaps() -> Scene:
    a, b = two_vehicles()
    return a + b, seen(a[2:7] + a[12:20], 1) + seen(b[:3] + b[15:], 2)


def blank_frames() -> Scene:
    truth = two_vehicles()[0]
    return truth, seen(truth[:8]) + seen(truth[12:])


def touching() -> Scene:
    truth = drive(1, range(1, FRAMES + 1), 100, 200, 0)
    return truth, [[*row[:2], row[2] + row[4], *row[3:6], 1] for row in truth]


def at_the_threshold() -> Scene:
    """Overlaps of exactly 0.5: 90 × 60 and the 90 × 30 in it; of just less in the second half."""
    truth = drive(1, range(1, FRAMES + 1), 100, 200, 0)
    halves = [[*row[:5], 30 if row[0] <= FRAMES // 2 else 29.75, 1] for row in truth]
    return truth, halves


def duplicates() -> Scene:
    truth = list(chain(*two_vehicles()))
    shifted = [[row[0], row[1] + 10, row[2] + 6, *row[3:6], 0.5] for row in truth]
    return truth, seen(truth, score=0.75) + shifted


def ignore_only() -> Scene:
    region: list[Row] = [[frame, 9, 0, 0, 700, 500, 1] for frame in range(1, FRAMES + 1)]
    return region, seen(list(chain(*two_vehicles())))


def ignore_beside() -> Scene:
    """Tracks on a vehicle, in a region, half in it by turns, and outside of all."""
    a, _ = two_vehicles()
    region: list[Row] = [[frame, 9, 0, 400, 300, 200, 1] for frame in range(1, FRAMES + 1)]
    inside = drive(5, range(3, 20), 20, 450, 2)
    leaving = drive(6, range(1, FRAMES + 1), 160, 420, 16)
    leaving = [row for row in leaving if row[2] < 210 or row[2] > 260]
    outside = drive(7, range(5, 9), 600, 100, 0)
    return a + region, seen(a[3:], 4) + seen(inside) + seen(leaving) + seen(outside)


def random_scene(seed: int) -> Scene:
    """Four vehicles, in each other's way for some seeds; jitter, misses, false alarms, new ids."""
    rng = np.random.default_rng(seed)
    truth: list[Row] = []
    found: list[Row] = []
    for vehicle in range(1, 5):
        first = int(rng.integers(1, 8))
        last = int(rng.integers(14, FRAMES + 1))
        start = rng.integers(0, 500 if seed % 4 else 80, size=2)
        step = float(rng.integers(-6, 7))
        rows = drive(vehicle, range(first, last + 1), float(start[0]), float(start[1]), step)
        truth += rows
        change = int(rng.integers(first, last + 8))
        for row in rows:
            if rng.random() < 0.2:
                continue
            shift = rng.integers(-80, 81, size=4) / 4 * (1 if seed % 2 else 0.5)
            track = vehicle if row[0] < change else vehicle % 4 + 1 + (4 if seed % 3 else 0)
            place = (np.array(row[2:6]) + shift).tolist()
            found.append([row[0], track, *place, float(rng.integers(1, 17)) / 16])
    for frame in range(1, FRAMES + 1):
        if rng.random() < 0.3:
            x, y = rng.integers(0, 600, size=2).tolist()
            found.append([frame, 30 + frame // 6, x, y, 80, 60, float(rng.integers(1, 9)) / 16])
    return truth, distinct(found)


def distinct(rows: list[Row]) -> list[Row]:
    """Drop the later of two rows with one id in one frame."""
    by_key: dict[tuple[float, float], Row] = {}
    for row in rows:
        by_key.setdefault((row[0], row[1]), row)
    return list(by_key.values())


NAMED: list[Callable[[], Scene]] = [
    *(perfect, empty_prediction, empty_truth, one_swap, one_split, gaps, blank_frames, touching),
    *(at_the_threshold, duplicates, ignore_only, ignore_beside),
]


def kitti_line(row: Row, *, truth: bool) -> str:
    frame, vehicle, x, y, width, height, last = row
    ignored = truth and last == 1
    name, vehicle = ("DontCare", -1) if ignored else ("Car", vehicle)
    box = f"{x!r} {y!r} {x + width!r} {y + height!r}"
    line = f"{int(frame) - 1} {int(vehicle)} {name} 0 0 -10 {box} -1 -1 -1 -1000 -1000 -1000 -10"
    return line if truth else f"{line} {last!r}"


def tracking_scores(scene: Scene) -> dict[str, float]:
    """Run trackeval over a scene written as KITTI files."""
    from trackeval import datasets, metrics  # type: ignore[import-not-found]

    truth, prediction = scene
    with tempfile.TemporaryDirectory() as name, contextlib.redirect_stdout(io.StringIO()):
        root = Path(name)
        (root / "label_02").mkdir()
        (root / "trackers/ours/data").mkdir(parents=True)
        lines = [kitti_line(row, truth=True) for row in truth]
        (root / "label_02/0000.txt").write_text("\n".join(lines))
        lines = [kitti_line(row, truth=False) for row in prediction]
        (root / "trackers/ours/data/0000.txt").write_text("\n".join(lines))
        (root / "evaluate_tracking.seqmap.training").write_text(f"0000 empty 000000 {FRAMES:06d}\n")
        settings = {
            "GT_FOLDER": name,
            "TRACKERS_FOLDER": str(root / "trackers"),
            "CLASSES_TO_EVAL": ["car"],
            "PRINT_CONFIG": False,
        }
        dataset = datasets.Kitti2DBox(settings)
        raw = dataset.get_raw_seq_data("ours", "0000")
        data = dataset.get_preprocessed_seq_data(raw, "car")
        quiet = {"PRINT_CONFIG": False}
        found: dict[str, Any] = {}
        for metric in (metrics.CLEAR(quiet), metrics.Identity(quiet), metrics.HOTA()):
            found |= metric.eval_sequence(data)
    return {name: np.mean(found[theirs]) for name, theirs in TRACKEVAL.items()}


def detection_scores(scene: Scene) -> dict[str, float]:
    """Run pycocotools over a scene; without vehicles it has no average precision, ours is 0."""
    from pycocotools.coco import COCO  # type: ignore[import-untyped]
    from pycocotools.cocoeval import COCOeval  # type: ignore[import-untyped]

    truth, prediction = scene
    if not prediction or not any(row[6] == 0 for row in truth):
        return {"ap50": 0.0, "ap50_95": 0.0}
    annotations = [
        {
            "id": number,
            "image_id": int(row[0]),
            "category_id": 1,
            "bbox": row[2:6],
            "area": row[4] * row[5],
            "iscrowd": int(row[6]),
        }
        for number, row in enumerate(truth, start=1)
    ]
    results = [
        {"image_id": int(row[0]), "category_id": 1, "bbox": row[2:6], "score": row[6]}
        for row in prediction
    ]
    with contextlib.redirect_stdout(io.StringIO()):
        coco = COCO()
        coco.dataset = {
            "info": {},
            "images": [{"id": frame} for frame in range(1, FRAMES + 1)],
            "categories": [{"id": 1, "name": "vehicle"}],
            "annotations": annotations,
        }
        coco.createIndex()
        evaluation = COCOeval(coco, coco.loadRes(results), "bbox")
        evaluation.evaluate()
        evaluation.accumulate()
        evaluation.summarize()
    return {"ap50": float(evaluation.stats[1]), "ap50_95": float(evaluation.stats[0])}


def case(name: str, scene: Scene) -> dict[str, Any]:
    expected = {**tracking_scores(scene), **detection_scores(scene)}
    return {
        "name": name,
        "tools": {tool: version(tool) for tool in ("trackeval", "pycocotools", "numpy", "scipy")},
        "truth": scene[0],
        "prediction": scene[1],
        "expected": {key: float(value) for key, value in expected.items()},
    }


def main() -> None:
    scenes = {make.__name__: make() for make in NAMED}
    scenes |= {f"random_{seed}": random_scene(seed) for seed in range(8)}
    for name, scene in scenes.items():
        text = json.dumps(case(name, scene))
        (HERE / f"{name}.json").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
