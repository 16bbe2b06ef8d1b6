"""How well vehicles are found in labelled pictures of many roads: `python -m benchmarks.pictures`.

A folder holds pictures and `annotations.json` in COCO form; `iscrowd: 1` marks an ignore region.
Each picture is searched for itself, as `vdet detect-image` does.
"""

import argparse
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from vdet.api import Detector, load_settings
from vdet.evaluate.labelled_video import LabelledVideo, Row
from vdet.evaluate.scores import Scores, score
from vdet.media.images import read_image


def main() -> None:
    """Print a row for each folder: precision, recall and F1 at IoU 0.5 of the boxes shown."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.pictures", description=main.__doc__)
    parser.add_argument("folders", nargs="+", type=Path, help="folders with annotations.json")
    parser.add_argument("--every", type=int, default=1, help="every n-th picture only")
    parser.add_argument("-c", "--config")
    parser.add_argument("--model", type=Path)
    options = parser.parse_args()
    detector = Detector(load_settings(options.config), options.model)
    print("| pictures of | pictures | vehicles | precision | recall | F1 | AP50 |")
    print("|---|---|---|---|---|---|---|")
    for folder in options.folders:
        pictures, scores = measure(folder, detector, options.every)
        ratios = (scores.precision, scores.recall, scores.f1, scores.ap50)
        cells = " | ".join(f"{ratio:.3f}" for ratio in ratios)
        print(f"| {folder.name} | {pictures} | {scores.vehicle_boxes} | {cells} |", flush=True)


def measure(folder: Path, detector: Detector, every: int) -> tuple[int, Scores]:
    """Search the pictures of a folder; return their number and the scores of all as one."""
    labels = json.loads((folder / "annotations.json").read_text(encoding="utf-8"))
    chosen = labels["images"][::every]
    numbers = {image["id"]: number for number, image in enumerate(chosen, start=1)}
    truth = LabelledVideo.from_rows(_true_rows(labels, numbers), frame_count=len(chosen))
    found = LabelledVideo.from_rows(_found_rows(folder, chosen, detector), frame_count=len(chosen))
    return len(chosen), score(found, truth)


def _true_rows(labels: dict[str, Any], numbers: dict[int, int]) -> Iterator[Row]:
    for label in labels["annotations"]:
        if number := numbers.get(label["image_id"]):
            x, y, width, height = label["bbox"]
            ignored = bool(label["iscrowd"])
            yield Row(0, number, label["id"], x, y, width, height, ignored=ignored)


def _found_rows(folder: Path, images: list[dict[str, Any]], detector: Detector) -> Iterator[Row]:
    count = 0
    for number, image in enumerate(images, start=1):
        found = detector.detect(read_image(folder / image["file_name"]))
        for box, certainty in zip(found.rounded, found.scores.tolist(), strict=True):
            count += 1
            yield Row(0, number, count, box.x, box.y, box.width, box.height, score=certainty)


if __name__ == "__main__":
    main()
