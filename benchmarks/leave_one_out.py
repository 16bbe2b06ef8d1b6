"""How well the network finds vehicles of cameras that it has not seen: `make unseen`.

Each group of sets is left out of a training in turn, and searched by the network that was trained
without it. `traffic_cams` is split into fifths of its cameras, `overpass` into its cameras. The
scores of all groups together give the calibration of the shipped network's scores. The last network
is trained without the video, and then follows the vehicles in it. Results are kept in the folder
`--work`; a run that was stopped goes on from there.
"""

import argparse
import json
import re
import zlib
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from sklearn.linear_model import LogisticRegression

from vdet.boxes import BoolArray, Float64Array
from vdet.config.loading import load_settings
from vdet.config.schema import NetworkSettings, Settings
from vdet.detect.factory import load_detector
from vdet.evaluate.average_precision import rank_predictions
from vdet.evaluate.comparison import pool
from vdet.evaluate.images import Counting, ImagesResult, MeasuredSet, evaluate_images
from vdet.evaluate.show_video import result_lines
from vdet.evaluate.video import Variant, evaluate_clips, open_clip
from vdet.labels.reading import read_labelled_pictures
from vdet.learn.net.run import NetworkJob, train_to_file
from vdet.workers import core_count

GROUPS = (
    ("idd",),
    ("cityscapes", "cityscapes_more", "cityscapes_negatives"),
    ("indonesia_web",),
    ("uk_residential",),
    ("us_dashcams", "us_dusk"),
    ("boston_roof",),
    *((f"traffic_cams.{fifth}",) for fifth in range(5)),
    ("overpass.kabul",),
    ("overpass.y",),
    ("overpass.night",),
    ("overpass.dense", "overpass.parking"),
)
LEAST_WIDTH = 0.03
"""Narrower vehicles are ignore regions, share of the picture's width."""

_SAME_CAMERA = {
    **dict.fromkeys(("c048", "c064"), "c001"),
    **dict.fromkeys(("c013", "cp000", "cp001"), "c012"),
    **dict.fromkeys(("cp003", "cp004"), "c018"),
}
"""Clips of `traffic_cams` from one camera."""

_LEAST_SCORE = 0.02
_UNCALIBRATED = ("train.net.score.slope=1", "train.net.score.offset=0")


def _fifth(picture: str) -> str:
    """Return the fifth of `traffic_cams` to which a picture belongs; a camera is in one."""
    clip = picture.partition("_")[0]
    return str(zlib.crc32(_SAME_CAMERA.get(clip, clip).encode()) % 5)


def _camera(picture: str) -> str:
    """Return the camera of a picture of `overpass`, the first word of its name."""
    return re.split(r"[^a-z]", picture)[0]


SPLITS = {"traffic_cams": _fifth, "overpass": _camera}
"""Functions from the name of a picture to that of its part, by the sets that are split."""


def split_sets(roads: Path, folder: Path) -> list[Path]:
    """Return all sets; those of `SPLITS` in parts, which are written into `folder`."""
    sets = []
    for path in sorted(each for each in roads.iterdir() if each.is_dir()):
        if path.name in SPLITS:
            sets += _split(path, SPLITS[path.name], folder)
        else:
            sets.append(path)
    return sets


def _split(path: Path, part_of: Callable[[str], str], folder: Path) -> list[Path]:
    labels = json.loads((path / "annotations.json").read_text(encoding="utf-8"))
    parts = defaultdict(list)
    for image in labels["images"]:
        parts[part_of(image["file_name"])].append(image)
    for name, images in parts.items():
        part = folder / f"{path.name}.{name}"
        part.mkdir(parents=True, exist_ok=True)
        numbers = {image["id"] for image in images}
        boxes = [each for each in labels["annotations"] if each["image_id"] in numbers]
        text = json.dumps({**labels, "images": images, "annotations": boxes})
        (part / "annotations.json").write_text(text, encoding="utf-8")
        for image in images:
            picture = part / image["file_name"]
            if not picture.exists():
                picture.symlink_to((path / image["file_name"]).resolve())
    return sorted(folder / f"{path.name}.{name}" for name in parts)


def train(job: NetworkJob, settings: Settings) -> Path:
    """Train a network, if there is none yet, and return its file."""
    if not job.output.exists():
        train_to_file(job, settings, progress=lambda step, _: _print_step(job, step))
    return job.output


def measure(sets: Sequence[Path], network: Path) -> ImagesResult:
    """Search sets of pictures."""
    detector = NetworkSettings(least=_LEAST_SCORE).showing_all()
    counting = Counting(detector.shown_score, LEAST_WIDTH)
    labelled = [read_labelled_pictures(path) for path in sets]
    model = load_detector(detector, network)
    return evaluate_images(labelled, model, counting, threads=core_count())


def ranked_logits(sources: Sequence[MeasuredSet]) -> tuple[Float64Array, BoolArray]:
    """Return the output of the network for each detection, and whether it finds a vehicle."""
    ranked = [rank_predictions(pool([i.every for i in each.images])) for each in sources]
    scores = np.clip(np.concatenate([each.scores for each in ranked]), 1e-6, 1 - 1e-6)
    return np.log(scores / (1 - scores)), np.concatenate([each.right[0] for each in ranked])


def fit_calibration(logits: Float64Array, right: BoolArray) -> tuple[float, float]:
    """Return slope and offset of the sigmoid that fits best (Platt, 1999)."""
    model = LogisticRegression(C=1e6).fit(logits[:, np.newaxis], right)
    return float(model.coef_[0, 0]), float(model.intercept_[0])


def _print_step(job: NetworkJob, step: int) -> None:
    if step % 500 == 0:
        print(f"{job.output.stem}: step {step}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("roads", type=Path, help="folder of sets of labelled pictures")
    parser.add_argument("video", type=Path, help="labelled video, in every training")
    parser.add_argument("truth", type=Path, help="its true boxes")
    parser.add_argument("--steps", type=int, default=4000, help="steps of each training")
    parser.add_argument("--work", type=Path, default=Path("build/leave_one_out"))
    parser.add_argument("--base", type=Path, help="network that has seen no group: the start")
    arguments = parser.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    settings = load_settings(None, [f"train.net.steps={arguments.steps}", *_UNCALIBRATED])
    clip = (arguments.video, arguments.truth)
    sets = split_sets(arguments.roads, arguments.work / "sets")
    results = []
    for group in GROUPS:
        left_out = [path for path in sets if path.name in group]
        learnt = tuple(path for path in sets if path.name not in group)
        output = arguments.work / f"without_{group[0]}.onnx"
        job = NetworkJob(learnt, (clip,), output, arguments.base)
        results.append(measure(left_out, train(job, settings)))
        print(f"without {', '.join(group)}: {results[-1].mean.best_f1:.3f}", flush=True)
    summary = summarize(results)
    print("\n".join(summary.lines()))
    path = arguments.work / "results.json"
    path.write_text(json.dumps(asdict(summary), indent=2) + "\n", encoding="utf-8")
    job = NetworkJob(tuple(sets), (), arguments.work / "without_the_video.onnx", arguments.base)
    network = train(job, load_settings(None, [f"train.net.steps={arguments.steps}"]))
    print("\n".join(video_lines(clip, network, settings)))


@dataclass(frozen=True, slots=True)
class SetScores:
    """Of a set that the network has not seen: F1 at the common score, and at its own best one."""

    name: str
    vehicles: int
    f1: float
    best_f1: float | None
    best_score: float | None
    ap50: float | None


@dataclass(frozen=True, slots=True)
class Summary:
    """The scores of all sets with vehicles, their means, and the calibration of the scores.

    `score` is the score, as the networks give it, at which the mean F1 of the groups is highest.
    """

    sets: tuple[SetScores, ...]
    score: float
    mean_f1: float
    mean_best_f1: float
    slope: float
    offset: float

    def lines(self) -> Iterator[str]:
        """Yield the summary as lines of text."""
        for each in self.sets:
            yield (
                f"{each.name:<20} {each.vehicles:5d} vehicles  F1 {each.f1:.3f}  "
                f"best {each.best_f1:.3f} at {each.best_score:.2f}  AP50 {each.ap50:.3f}"
            )
        yield (
            f"mean F1 of the groups {self.mean_f1:.3f} at score {self.score:.2f}; "
            f"each at its best score {self.mean_best_f1:.3f}"
        )
        yield f"train.net.score.slope={self.slope:.3f} train.net.score.offset={self.offset:.3f}"


def summarize(results: Sequence[ImagesResult]) -> Summary:
    """Return the scores at one score for all groups, and fit the calibration to all detections."""
    sources = [source for result in results for source in result.sources]
    scores = np.unique(np.concatenate([source.curve.scores for source in sources]))
    means = np.mean([_group_f1(result, scores) for result in results], axis=0)
    common = scores[np.argmax(means)]
    slope, offset = fit_calibration(*ranked_logits(sources))
    bests = [result.mean.best_f1 for result in results if result.mean.best_f1 is not None]
    return Summary(
        sets=tuple(
            SetScores(
                Path(source.labelled.name).name,
                source.scores.vehicles,
                float(source.curve.at(common)),
                source.scores.best_f1,
                source.scores.best_score,
                source.scores.ap50,
            )
            for result in results
            for source in result.sources
            if source.scores.vehicles
        ),
        score=float(common),
        mean_f1=float(means.max()),
        mean_best_f1=float(np.mean(bests)),
        slope=slope,
        offset=offset,
    )


def video_lines(clip: tuple[Path, Path], network: Path, settings: Settings) -> list[str]:
    """Return how well a network finds and follows the vehicles of a video."""
    variant = Variant(settings, load_detector(settings.detector, network), ())
    return list(result_lines(evaluate_clips([open_clip(*clip)], [variant])))


def _group_f1(result: ImagesResult, scores: Float64Array) -> Float64Array:
    """Return the mean F1 of the sets with vehicles at each of `scores`."""
    curves = [source.curve for source in result.sources if source.scores.vehicles]
    return np.asarray(np.mean([curve.at(scores) for curve in curves], axis=0))


if __name__ == "__main__":
    main()
