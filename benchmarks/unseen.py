"""How well the network finds and names vehicles of cameras it has not seen: `make unseen`.

The cameras of all sets are dealt into folds. Each training leaves one fold out, and its network
searches the pictures of that fold; the last training leaves the video out too, and its network
follows the vehicles in it. Every picture is searched as `vdet eval images` does, for the tables,
and as a frame of a video: these detections give the calibration of the shipped network (`make
ship`), for all boxes and by class. Networks given by `--model` search the same pictures.

Checkpoints, networks and findings are kept in the folder `--work`: a stopped run resumes there.
"""

import argparse
import json
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import compress, repeat
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from sklearn.linear_model import LogisticRegression

from vdet.boxes import BoolArray, Float64Array, Image, Int64Array
from vdet.config.classes import STANDARD_CLASSES, UNKNOWN
from vdet.config.loading import load_settings
from vdet.config.schema import NetworkSettings
from vdet.detect.detectors import DetectorModel, load_detector
from vdet.detect.onnx.detector import NetworkDetector
from vdet.detect.onnx.network import ScoreCalibration, Session, read_header
from vdet.evaluate.results import (
    Counting,
    RunName,
    best_f1,
    evaluate_images,
    evaluate_video,
    figure,
    table,
    video_report,
)
from vdet.evaluate.scores import MATCH_IOU, ComparedFrame, RankedPredictions, pool
from vdet.files import json_text, write_whole
from vdet.labels.images import LabelledImages
from vdet.labels.reading import Roles, read_labelled_images, read_truth

OURS = "trained without them"
"""The name of our networks in `results.json`."""

_SAME_CAMERA = {
    **dict.fromkeys(("c048", "c064"), "c001"),
    **dict.fromkeys(("c013", "cp000", "cp001"), "c012"),
    **dict.fromkeys(("cp003", "cp004"), "c018"),
    **dict.fromkeys(("cityscapes_more", "cityscapes_negatives"), "cityscapes"),
    "us_dusk": "us_dashcams",
}
"""Clips and sets from one camera, or one city."""

_HIGH = {
    *("traffic_cams", "overpass", "vietnam_street", "lake_county_cctv"),
    *("topview_roads", "toll_km39", "manaus_misc"),
}
"""Sets from poles and bridges."""
_MIN_WIDTHS = {False: 0.03, True: 0.02}
"""Narrower objects are ignore regions, fraction of the picture's width; True: for `_HIGH`."""

_MIN_SCORE = 2e-3  # of a calibrated network; hardly any box below shows an object
_ENOUGH = 50  # right boxes of a class that has a calibration of its own
_FROM_RANDOM = "train.net.learning_rate=0.002"  # the default rate is for a training from a base


def camera_of(set_: str, picture: Path) -> str:
    """Return the camera of a picture, as far as names tell it; that of many sets is the set."""
    words = picture.stem.split("_")
    if set_ == "traffic_cams":
        return _SAME_CAMERA.get(words[0], words[0])
    if set_ == "overpass":
        return words[0]
    if len(words) > 1 and words[0].isdecimal():  # 0001_camera.webp
        return words[1]
    return _SAME_CAMERA.get(set_, set_)


def deal(sets: Sequence[LabelledImages], folds: int) -> list[Int64Array]:
    """Return the fold of every picture of all sets: in turn, camera by camera of a set.

    The sets that are one camera each are dealt like the cameras of one set.
    """
    cameras: dict[str, dict[str, int]] = defaultdict(dict)
    dealt = []
    for labelled in sets:
        name, numbers = Path(labelled.name).name, []
        for picture in labelled.images:
            camera = camera_of(name, picture.path)
            known = cameras["" if camera == _SAME_CAMERA.get(name, name) else name]
            numbers.append(known.setdefault(camera, len(known)) % folds)
        dealt.append(np.array(numbers, np.int64))
    return dealt


class Finding(NamedTuple):
    """A detection: its set, its class, its score, and the class of what it finds, if anything."""

    set: str
    named: str
    score: float
    found: str | None


@dataclass(frozen=True, slots=True)
class Findings:
    """All detections of a network in some pictures, and the number of objects by set and class."""

    rows: Sequence[Finding]
    objects: dict[str, dict[str, int]]

    @classmethod
    def joined(cls, parts: Sequence["Findings"]) -> "Findings":
        """Return the findings of all folds."""
        objects: dict[str, Counter[str]] = defaultdict(Counter)
        for part in parts:
            for name, counts in part.objects.items():
                objects[name].update(counts)
        return cls([row for part in parts for row in part.rows], dict(objects))

    @classmethod
    def load(cls, path: Path) -> "Findings":
        """Read findings that were written as JSON."""
        values = json.loads(path.read_text(encoding="utf-8"))
        return cls([Finding(*row) for row in values["rows"]], values["objects"])


@dataclass(frozen=True, slots=True)
class _AsFrames:
    """A network that searches each image once, like a frame of a video."""

    model: DetectorModel

    def for_video(self, width: int, height: int, images: Sequence[Image]) -> NetworkDetector:
        detector = self.model.for_video(width, height, images)
        assert isinstance(detector, NetworkDetector)
        return replace(detector, larger=detector.network)


def measure(
    sets: Sequence[LabelledImages], network: Path, classes: Sequence[str], *, as_frames: bool
) -> Findings:
    """Search pictures, each as an image or a frame of a video, and compare all with the labels."""
    settings = NetworkSettings(
        model=str(network), min_score=_MIN_SCORE, classes=(*classes, UNKNOWN)
    ).showing_all()
    model: DetectorModel = load_detector(settings)
    if as_frames:
        model = _AsFrames(model)
    rows, objects = list[Finding](), {}
    for labelled in sets:
        name = Path(labelled.name).name
        counting = Counting(0.0, _MIN_WIDTHS[name in _HIGH])
        [measured] = evaluate_images([labelled], model, counting)
        every = pool([image.every for image in measured.images])
        names = (*every.vehicle_names, None)  # -1 is the last
        for frame in every.frames:
            named = [every.track_names[track] for track in frame.tracks.tolist()]
            found = [names[row] for row in _found(frame).tolist()]
            scores = frame.scores.round(5).tolist()
            rows += map(Finding, repeat(name), named, scores, found)
        objects[name] = dict(Counter(every.vehicle_names))
    return Findings(rows, objects)


def _found(frame: ComparedFrame) -> Int64Array:
    """Return the vehicle that each detection finds, the best score first; -1 for none, `(m,)`."""
    found, free = np.full(len(frame.tracks), -1), frame.iou.copy()
    for column in np.argsort(-frame.scores, kind="stable").tolist():
        if free[:, column].max(initial=0) >= MATCH_IOU:
            row = int(np.argmax(free[:, column]))
            found[column], free[row] = frame.vehicles[row], -1
    return found


def fit(rows: Sequence[Finding], given: ScoreCalibration) -> ScoreCalibration:
    """Fit slope and offset anew, so that the score is the fraction of boxes that are right.

    `given` is the calibration of the network that gave the scores.
    Source: Platt, "Probabilistic outputs for support vector machines", 1999.
    """
    right: BoolArray = np.array([row.found is not None for row in rows])
    if not right.any() or right.all():
        return given
    scores = np.array([row.score for row in rows]).clip(1e-6, 1 - 1e-6)
    logits: Float64Array = np.log(scores / (1 - scores))
    model = LogisticRegression(C=1e6).fit(logits[:, np.newaxis], right)
    slope, offset = float(model.coef_[0, 0]), float(model.intercept_[0])
    return ScoreCalibration(
        slope=round(slope * given.slope, 4), offset=round(slope * given.offset + offset, 4)
    )


def summarize(findings: Findings) -> dict[str, Any]:
    """Return the best F1 of every set and class, as JSON values."""
    totals = sum(map(Counter, findings.objects.values()), Counter[str]())
    by_class = _by_class(findings)
    sets = {
        name: _scores([row for row in findings.rows if row.set == name], None, sum(counts.values()))
        for name, counts in findings.objects.items()
        if counts
    }
    order = (*STANDARD_CLASSES, *sorted(by_class)).index
    classes = {
        name: _scores([row for row in by_class[name] if row.found != UNKNOWN], name, totals[name])
        for name in sorted(by_class.keys() - {UNKNOWN}, key=order)
    }
    return {"sets": sets, "classes": classes}


def calibrate(findings: Findings, given: ScoreCalibration) -> dict[str, Any]:
    """Return the calibrations of all boxes and of each class with enough of them, as JSON values.

    `given` is the calibration of the network that gave the scores.
    """
    by_class = {
        name: fit(rows, given).model_dump()
        for name, rows in _by_class(findings).items()
        if sum(row.found is not None for row in rows) >= _ENOUGH
    }
    return {"calibration": fit(findings.rows, given).model_dump(), "by_class": by_class}


def _by_class(findings: Findings) -> dict[str, list[Finding]]:
    """Return the detections of each class that is detected or labelled."""
    names = {row.named for row in findings.rows}.union(*findings.objects.values())
    rows: dict[str, list[Finding]] = {name: [] for name in sorted(names)}
    for row in findings.rows:
        rows[row.named].append(row)
    return rows


def _scores(rows: Sequence[Finding], name: str | None, objects: int) -> dict[str, float]:
    """Return the scores of detections; with a name, those are right that find its class."""
    rows = sorted(rows, key=lambda row: -row.score)
    right = [row.found is not None if name is None else row.found == name for row in rows]
    scores = np.array([row.score for row in rows], np.float64)
    result = RankedPredictions(scores, np.array([right], np.bool_), objects)
    best, at_score = best_f1([result])
    ap50, _ = result.average_precisions()
    return {"objects": objects, "best_f1": best, "at_score": at_score, "ap50": ap50}


def summary_lines(name: str, summary: dict[str, Any]) -> Iterator[str]:
    """Yield tables of the sets and the classes, and the calibrations, as lines of text."""
    yield f"{name}:"
    for part in ("sets", "classes"):
        rows = [
            [one, str(values["objects"]), *map(figure, list(values.values())[1:])]
            for one, values in summary[part].items()
        ]
        yield from table((part, "objects", "best F1", "at score", "AP50"), rows)
    if "calibration" in summary:
        for one, values in {"all": summary["calibration"], **summary["by_class"]}.items():
            yield f"calibration of {one}: slope {values['slope']}, offset {values['offset']}"
    yield ""


class Unseen:
    """The trainings and measurements of all folds, kept in a folder."""

    def __init__(self, arguments: argparse.Namespace) -> None:
        self._work, self._folds = arguments.work, arguments.folds
        steps = [f"train.net.steps={arguments.steps}"] if arguments.steps else []
        self.settings = load_settings((), [*steps, _FROM_RANDOM, *arguments.set])
        self._video, self._truth = arguments.video, arguments.truth
        self._paths = sorted(path for path in arguments.roads.iterdir() if path.is_dir())
        classes = self.settings.train.net.classes
        labels = Roles.of({}, (*classes, UNKNOWN))
        self._sets = [read_labelled_images(path, labels) for path in self._paths]
        self._dealt = deal(self._sets, self._folds)
        self._sources: list[Any] = []

    def network(self, fold: int) -> Path:
        """Train a network without a fold, unless it is there, and return its file."""
        output: Path = self._work / f"without_{fold}.onnx"
        if output.exists():
            return output
        from vdet.learn.net.sources import clip_source, image_source
        from vdet.learn.net.training import train_to_file

        if not self._sources:
            roles = Roles.for_training(self.settings)
            sets = [read_labelled_images(path, roles) for path in self._paths]
            self._sources = [image_source(labelled, self.settings) for labelled in sets]
        sources = []
        for source, folds in zip(self._sources, self._dealt, strict=True):
            kept = np.flatnonzero(folds != fold).tolist()
            if kept:
                samples = [source.samples[number] for number in kept]
                sources.append(replace(source, samples=samples))
        if fold < self._folds - 1:
            sources.append(clip_source(self._video, self._truth, self.settings))

        def progress(step: int, loss: float) -> None:
            if step % 100 == 0:
                print(f"{output.stem}: step {step}, loss {loss:.3f}", flush=True)

        train_to_file(sources, self.settings.train.net, output, progress=progress)
        return output

    def findings(self, network: Path, fold: int, *, as_frames: bool) -> Findings:
        """Search the pictures of a fold, unless that is done, and return the findings."""
        path = self._work / f"{'frames' if as_frames else 'images'}_{network.stem}_{fold}.json"
        if not path.exists():
            sets = [
                replace(labelled, images=tuple(compress(labelled.images, folds == fold)))
                for labelled, folds in zip(self._sets, self._dealt, strict=True)
                if fold in folds
            ]
            classes = self.settings.train.net.classes
            found = measure(sets, network, classes, as_frames=as_frames)
            write_whole(path, json_text(asdict(found)), overwrite=True)
            print(f"{path}: searched", flush=True)
        return Findings.load(path)

    def video_lines(self, network: Path) -> list[str]:
        """Return how well a network finds and follows the vehicles of the video."""
        model = load_detector(NetworkSettings(model=str(network)))
        truth = read_truth(self._truth, Roles.from_settings(self.settings))
        found = evaluate_video(self._video, truth, self.settings, model)
        return video_report([found], RunName("net", network, None)).lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("roads", type=Path, help="folder of sets of labelled pictures")
    parser.add_argument("video", type=Path, help="labelled video, in every training but the last")
    parser.add_argument("truth", type=Path, help="its true boxes")
    parser.add_argument("--folds", type=int, default=6, help="number of trainings")
    steps = "steps of each training; 0: none, only the networks of --model are measured"
    parser.add_argument("--steps", type=int, default=4000, help=steps)
    work = "networks and findings; other steps, folds and settings need another folder"
    parser.add_argument("--work", type=Path, default=Path("build/unseen"), help=work)
    parser.add_argument("--model", type=Path, action="append", default=[], help="measured too")
    parser.add_argument(
        "--set", action="append", default=[], help="setting, as train.net.steps=2000"
    )
    arguments = parser.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    unseen = Unseen(arguments)
    found: dict[str, list[list[Findings]]] = defaultdict(list)
    networks: dict[str, Path] = {}
    for fold in range(arguments.folds):
        networks = {OURS: unseen.network(fold)} if arguments.steps else {}
        networks |= {str(model): model for model in arguments.model}
        for name, network in networks.items():
            found[name].append(
                [unseen.findings(network, fold, as_frames=as_frames) for as_frames in (False, True)]
            )
    results = {}
    for name, parts in found.items():
        header = read_header(Session(networks[name]))
        images, frames = map(Findings.joined, zip(*parts, strict=True))
        results[name] = summarize(images)
        if header and not header.by_class:
            results[name] |= calibrate(frames, header.calibration)
        print("\n".join(summary_lines(name, results[name])))
    write_whole(arguments.work / "results.json", json_text(results), overwrite=True)
    if arguments.steps:
        print("\n".join(unseen.video_lines(networks[OURS])))


if __name__ == "__main__":
    main()
