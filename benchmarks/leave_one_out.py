"""How well the network finds vehicles of cameras that it has not seen: `make unseen`.

Each training leaves out one group of sets of each kind, and its network searches them.
`traffic_cams` is split into fifths of its cameras, `overpass` into its cameras. The scores of all
groups together give the calibration of the shipped network's scores. Networks given by `--model`
search the same pictures. The last training leaves out the video too, and its network follows the
vehicles in it. Results are kept in the folder `--work`; a stopped run goes on there.
"""

import argparse
import json
import re
import zlib
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import zip_longest
from pathlib import Path

import numpy as np
from sklearn.linear_model import LogisticRegression

from vdet.boxes import BoolArray, Float64Array
from vdet.config.loading import load_settings
from vdet.config.schema import NetworkSettings, Settings
from vdet.config.train import NetworkScoreSettings
from vdet.detect.factory import load_detector, trained_on
from vdet.evaluate.images import Counting, ImagesResult, MeasuredSet, evaluate_images
from vdet.evaluate.output import RunName, figure, share, table
from vdet.evaluate.report import video_report
from vdet.evaluate.video import Variant, evaluate_clips, open_clip
from vdet.labels.reading import read_labelled_pictures
from vdet.learn.net.run import NetworkJob, read_sources, train_to_file
from vdet.workers import core_count

Group = tuple[str, ...]

KINDS: dict[str, tuple[Group, ...]] = {
    "windscreens and streets": (
        ("idd",),
        ("cityscapes", "cityscapes_more", "cityscapes_negatives"),
        ("indonesia_web",),
        ("uk_residential",),
        ("us_dashcams", "us_dusk"),
        ("boston_roof",),
    ),
    "traffic_cams by fifths": tuple((f"traffic_cams.{fifth}",) for fifth in range(5)),
    "overpass by camera": (
        ("overpass.kabul",),
        ("overpass.y",),
        ("overpass.night",),
        ("overpass.dense", "overpass.parking"),
    ),
}
"""The groups of sets by their kind; the n-th training leaves out the n-th group of each kind."""

ByKind = Mapping[str, list[ImagesResult]]
"""The results of all groups, by their kind."""

_NEAR, _FAR = 0.03, 0.02
"""Narrower vehicles are ignore regions, fraction of the picture's width: of the first kind, and of
cameras on poles and bridges.
"""

_SAME_CAMERA = {
    **dict.fromkeys(("c048", "c064"), "c001"),
    **dict.fromkeys(("c013", "cp000", "cp001"), "c012"),
    **dict.fromkeys(("cp003", "cp004"), "c018"),
}
"""Clips of `traffic_cams` from one camera."""

_LEAST_SCORE = 5e-5  # of a calibrated network; its output is about 0.02 there
_OURS = "trained without them"
_FROM_RANDOM = "train.net.learning_rate=0.002"  # the default rate is for a training from a base


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
    for path in sorted(item for item in roads.iterdir() if item.is_dir()):
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
        boxes = [label for label in labels["annotations"] if label["image_id"] in numbers]
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
        sources = read_sources(job, settings)
        train_to_file(job, sources, settings, progress=lambda step, _: _print_step(job, step))
    return job.output


def measure(sets: Sequence[Path], network: Path) -> ImagesResult:
    """Search the sets of a group."""
    detector = NetworkSettings(min_score=_LEAST_SCORE, model=str(network)).showing_all()
    is_far = sets[0].name.partition(".")[0] in SPLITS
    counting = Counting(detector.shown_score, _FAR if is_far else _NEAR)
    labelled = [read_labelled_pictures(path) for path in sets]
    model = load_detector(detector)
    return evaluate_images(labelled, model, counting, threads=core_count())


def ranked_logits(sources: Sequence[MeasuredSet]) -> tuple[Float64Array, BoolArray]:
    """Return the logit of each detection's score, and whether the detection finds a vehicle."""
    scores = np.concatenate([source.ranked.scores for source in sources]).clip(1e-6, 1 - 1e-6)
    right = np.concatenate([source.ranked.right[0] for source in sources])
    return np.log(scores / (1 - scores)), right


def fit_calibration(logits: Float64Array, right: BoolArray) -> tuple[float, float]:
    """Return slope and offset of the sigmoid that fits the logits best (Platt, 1999)."""
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
    work = "networks and results; those of other steps and settings need another folder"
    parser.add_argument("--work", type=Path, default=Path("build/leave_one_out"), help=work)
    parser.add_argument("--base", type=Path, help="network that has seen no group: the start")
    parser.add_argument("--model", type=Path, action="append", default=[], help="measured too")
    parser.add_argument(
        "--set", action="append", default=[], help="setting, as train.net.width=320"
    )
    arguments = parser.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    rate = [] if arguments.base else [_FROM_RANDOM]
    settings = load_settings((), [f"train.net.steps={arguments.steps}", *rate, *arguments.set])
    clip = (arguments.video, arguments.truth)
    sets = split_sets(arguments.roads, arguments.work / "sets")
    results: dict[str, ByKind] = defaultdict(lambda: defaultdict(list))
    trainings = list(zip_longest(*KINDS.values(), fillvalue=()))
    for groups in trainings:
        names = [name for group in groups for name in group]
        learnt = tuple(path for path in sets if path.name not in names)
        clips = () if groups is trainings[-1] else (clip,)
        output = arguments.work / f"without_{names[0]}.onnx"
        ours = train(NetworkJob(learnt, clips, output, arguments.base), settings)
        networks = {_OURS: ours, **{str(item): item for item in arguments.model}}
        for kind, group in zip(KINDS, groups, strict=True):
            if not group:
                continue
            left_out = [path for path in sets if path.name in group]
            for name, network in networks.items():
                result = measure(left_out, network)
                results[name][kind].append(result)
                best = figure(result.mean.best_f1)
                print(f"{', '.join(group)}: best F1 {best} ({name})", flush=True)
    summaries = {name: summarize(result) for name, result in results.items()}
    print("\n".join(summary_lines(summaries, settings.train.net.score)))
    for model in arguments.model:
        seen = trained_on(NetworkSettings(model=str(model)))
        print(f"{model} has seen: {', '.join(seen) or 'not known'}")
    path = arguments.work / "results.json"
    values = {name: asdict(summary) for name, summary in summaries.items()}
    path.write_text(json.dumps(values, indent=2) + "\n", encoding="utf-8")
    print("\n".join(video_lines(clip, ours, settings)))


@dataclass(frozen=True, slots=True)
class SetScores:
    """Of a set: F1 at the common score, and at its own best one."""

    name: str
    vehicles: int
    f1: float
    best_f1: float
    best_score: float
    ap50: float


@dataclass(frozen=True, slots=True)
class Summary:
    """The scores of a network in all sets with vehicles, the means of the kinds, a calibration.

    `score` is the score at which the mean F1 of the groups is highest.
    `means` has the mean F1 of the groups of each kind at that score, and at the best of each group.
    `slope` and `offset` calibrate the scores that the network gives; 1 and 0 leave them unchanged.
    """

    sets: tuple[SetScores, ...]
    score: float
    means: dict[str, tuple[float, float]]
    slope: float
    offset: float


def summary_lines(summaries: Mapping[str, Summary], given: NetworkScoreSettings) -> Iterator[str]:
    """Yield a table of the sets that were left out, and the calibration, as lines of text.

    `given` is the calibration that our networks have been given.
    """
    ours, *others = summaries.values()
    names = [Path(name).name for name in summaries][1:]
    headings = ("left out", "vehicles", "F1", "best F1", "at score", "AP50", *names)
    rows = []
    for set_, *more in zip(ours.sets, *(other.sets for other in others), strict=True):
        ratios = set_.f1, set_.best_f1, set_.best_score, set_.ap50, *(one.best_f1 for one in more)
        rows.append([set_.name, str(set_.vehicles), *map(figure, ratios)])
    for kind, (f1, best) in ours.means.items():
        theirs = (share(other.means[kind][1]) for other in others)
        rows.append([f"mean, {kind}", "", share(f1), share(best), "", "", *theirs])
    yield from table(headings, rows)
    yield f"F1 is at score {ours.score:.2f} in all sets; of other networks: the best of each set"
    slope, offset = ours.slope * given.slope, ours.slope * given.offset + ours.offset
    yield f"train.net.score.slope={slope:.3f} train.net.score.offset={offset:.3f}"


def summarize(by_kind: ByKind) -> Summary:
    """Return the scores at one score for all groups, and fit the calibration to all detections."""
    results = [result for item in by_kind.values() for result in item]
    sources = [source for result in results for source in result.sources]
    scores = np.unique(np.concatenate([source.ranked.scores for source in sources]))
    common = scores[np.argmax(_mean_f1(results, scores))]
    slope, offset = fit_calibration(*ranked_logits(sources))
    means = {}
    for kind, item in by_kind.items():
        bests = [result.mean.best_f1 for result in item]
        means[kind] = float(_mean_f1(item, common)), float(np.mean(bests))
    return Summary(
        sets=tuple(
            SetScores(
                Path(source.labelled.name).name,
                source.scores.vehicles,
                float(source.ranked.f1_at(common)),
                source.scores.best_f1,
                source.scores.best_score,
                source.scores.ap50,
            )
            for result in results
            for source in result.sources
            if source.scores.vehicles
        ),
        score=float(common),
        means=means,
        slope=slope,
        offset=offset,
    )


def video_lines(clip: tuple[Path, Path], network: Path, settings: Settings) -> list[str]:
    """Return how well a network finds and follows the vehicles of a video."""
    model = load_detector(NetworkSettings(model=str(network)))
    runs = evaluate_clips([open_clip(*clip)], [Variant(settings, model)])
    return video_report(runs, RunName("net", network, None)).lines()


def _mean_f1(results: Sequence[ImagesResult], scores: Float64Array) -> Float64Array:
    """Return the mean F1 of groups at each of `scores`; of a group, that of its sets."""
    groups = []
    for result in results:
        known = [source.ranked for source in result.sources if source.ranked.vehicles]
        groups.append(np.mean([ranked.f1_at(scores) for ranked in known], axis=0))
    return np.asarray(np.mean(groups, axis=0))


if __name__ == "__main__":
    main()
