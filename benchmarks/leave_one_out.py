"""How well the network finds vehicles of cameras that it has not seen: `make unseen`.

Each group of sets is left out of a training in turn, and searched by the network that was trained
without it. The scores of all groups together give the calibration of the shipped network's scores.
Results are kept in the folder `--work`; a run that was stopped goes on from there.
"""

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from sklearn.linear_model import LogisticRegression

from vdet.config.loading import find_config, load_settings
from vdet.config.schema import NetworkSettings, Settings
from vdet.detect.factory import load_detector
from vdet.evaluate.images.evaluate import ImagesResult, evaluate_images
from vdet.evaluate.images.reading import read_labelled_images
from vdet.evaluate.images.scores import Counting
from vdet.evaluate.matching import match
from vdet.geometry import BoolArray, Float64Array
from vdet.learn.network.run import NetworkJob, train_to_file
from vdet.learn.network.sources import LabelledClip
from vdet.workers import core_count

GROUPS = (
    ("idd",),
    ("cityscapes", "cityscapes_more", "cityscapes_negatives"),
    ("indonesia_web",),
    ("uk_residential",),
    ("us_dashcams", "us_dusk"),
    ("boston_roof",),
)
LEAST_WIDTH = 0.03
"""Narrower vehicles are ignore regions, share of the picture's width."""

_LEAST_SCORE = 0.02


@dataclass(frozen=True, slots=True)
class GroupResult:
    """What one training reached on the sets that it has not seen.

    `logits` and `right` tell of each detection its output, and whether it finds a vehicle.
    """

    names: tuple[str, ...]
    f1: tuple[float | None, ...]
    best_scores: tuple[float | None, ...]
    ap50: tuple[float | None, ...]
    logits: tuple[float, ...]
    right: tuple[bool, ...]


def run_group(
    group: Sequence[str], roads: Path, clip: LabelledClip, settings: Settings, work: Path
) -> GroupResult:
    """Train without a group and search it."""
    names = sorted(path.name for path in roads.iterdir() if path.is_dir())
    output = work / f"without_{group[0]}.onnx"
    if not output.exists():
        learnt = tuple(roads / name for name in names if name not in group)
        job = NetworkJob(learnt, (clip,), output)
        train_to_file(job, settings.network, progress=lambda state: _print_step(group, state.step))
    detector = NetworkSettings(least=_LEAST_SCORE).showing_all()
    counting = Counting(_LEAST_SCORE, LEAST_WIDTH, detector.classes)
    sets = [read_labelled_images(roads / name) for name in group]
    model = load_detector(detector, output)
    result = evaluate_images(sets, model, counting, threads=core_count())
    scores = [source.scores for source in result.sources]
    logits, right = _detections(result)
    return GroupResult(
        tuple(group),
        tuple(each.best_f1 for each in scores),
        tuple(each.best_score for each in scores),
        tuple(each.ap50 for each in scores),
        tuple(np.round(logits, 4).tolist()),
        tuple(right.tolist()),
    )


def _detections(result: ImagesResult) -> tuple[Float64Array, BoolArray]:
    """Return the output of the network for each detection that counts, and whether it is right."""
    logits: list[float] = []
    right: list[bool] = []
    for source in result.sources:
        for image in source.images:
            for frame in match(image.compare(_LEAST_SCORE)):
                scores = np.clip(frame.frame.scores, 1e-6, 1 - 1e-6)
                logits += np.log(scores / (1 - scores)).tolist()
                hits = np.zeros(len(scores), np.bool_)
                hits[frame.track_rows] = True
                right += hits.tolist()
    return np.array(logits), np.array(right, np.bool_)


def fit_calibration(logits: Float64Array, right: BoolArray) -> tuple[float, float]:
    """Return slope and offset of the sigmoid that fits best (Platt, 1999)."""
    model = LogisticRegression(C=1e6).fit(logits[:, np.newaxis], right)
    return float(model.coef_[0, 0]), float(model.intercept_[0])


def _print_step(group: Sequence[str], step: int) -> None:
    if step % 500 == 0:
        print(f"without {group[0]}: step {step}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("roads", type=Path, help="folder of sets of labelled pictures")
    parser.add_argument("video", type=Path, help="labelled video, in every training")
    parser.add_argument("truth", type=Path, help="its true boxes")
    parser.add_argument("--steps", type=int, default=4000, help="steps of each training")
    parser.add_argument("--work", type=Path, default=Path("build/leave_one_out"))
    arguments = parser.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    settings = load_settings(find_config("net"), [f"network.steps={arguments.steps}"])
    clip = LabelledClip(arguments.video, arguments.truth, settings.network.every)
    results = []
    for group in GROUPS:
        results.append(run_group(group, arguments.roads, clip, settings, arguments.work))
        print(_line(results[-1]), flush=True)
    print(_summary(results))
    path = arguments.work / "results.json"
    path.write_text(json.dumps([asdict(each) for each in results]), encoding="utf-8")


def _line(result: GroupResult) -> str:
    parts = [
        f"{name}: best F1 {f1:.3f} at {score:.2f}, AP50 {ap50:.3f}"
        for name, f1, score, ap50 in zip(
            result.names, result.f1, result.best_scores, result.ap50, strict=True
        )
        if f1 is not None and score is not None and ap50 is not None
    ]
    return "; ".join(parts)


def _summary(results: Sequence[GroupResult]) -> str:
    means = [float(np.mean([f1 for f1 in result.f1 if f1 is not None])) for result in results]
    logits = np.array([each for result in results for each in result.logits])
    right = np.array([each for result in results for each in result.right])
    slope, offset = fit_calibration(logits, right)
    return (
        f"mean of {len(means)} groups: best F1 {np.mean(means):.3f}\n"
        f"calibration of scores: network.score.slope={slope:.3f} network.score.offset={offset:.3f}"
    )


if __name__ == "__main__":
    main()
