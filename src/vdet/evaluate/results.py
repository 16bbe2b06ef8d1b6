"""The results of a detector or tracker in labelled images and videos, and reports of them.

A report has text, values for JSON, and a page that shows the mistakes.
"""

import logging
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from itertools import compress
from pathlib import Path
from statistics import fmean
from typing import Any, Self

import cv2
import numpy as np

from vdet.boxes import Box, Boxes, Float64Array, Image
from vdet.config.schema import InputSettings, Settings
from vdet.detect.detectors import DetectorModel
from vdet.draw import Color
from vdet.errors import printable, quantity
from vdet.evaluate.scores import (
    ClassResult,
    ComparedFrame,
    Comparison,
    DetectionScores,
    RankedPredictions,
    Scores,
    class_results,
    compare,
    compare_frames,
    pool,
    rank_predictions,
    score_boxes,
    score_comparison,
)
from vdet.findings import warnings_in
from vdet.labels.images import LabelledImage, LabelledImages
from vdet.labels.label import SavedTracks
from vdet.labels.reading import Roles, read_tracks, read_truth
from vdet.media.reader import VideoReader
from vdet.pages.render import render
from vdet.regions import Regions
from vdet.run.images import ImageSearch
from vdet.run.loop import Parts
from vdet.run.video import Results, Run
from vdet.track.track import Track
from vdet.version import __version__
from vdet.workers import Progress, SearchThreads, no_progress

_MAX_DETECTIONS = 1000  # in an image, those of the highest scores

_log = logging.getLogger("vdet")

_DEFAULT = Settings()

TRUE: Color = (90, 220, 60)
DETECTED: Color = (40, 120, 255)

_MAX_IMAGES, _MAX_CROPS = 9, 24  # of each source; of each video
_SCALE = 3.0  # width of the part around a box, in sizes of the box

_Mistake = tuple[ComparedFrame, Float64Array, float]
"""A box without a pair in a frame, and its best IoU with any box of the other side.

Near 0: no such box. Below 0.5: a poor fit. Above: the other box is matched with another one.
"""

_Named = tuple[str, object]
"""A name and its scores."""

_OF_BOXES = "precision", "recall", "f1", "ap50", "mean_iou", "false_positives"
_OF_IMAGES = "images", "vehicles", *_OF_BOXES, "best_f1", "best_score"
_OF_TRACKS = "mota", "idf1", "hota", "id_switches", "false_tracks", "mean_delay"
_OF_VIDEO = *_OF_BOXES, "misses", *_OF_TRACKS
_OF_CLASSES = "vehicles", "found", "right", "precision", "recall", "f1", "confused"
"""The columns of tables: attributes of scores."""

_HEADINGS = {
    "f1": "F1", "ap50": "AP50", "mean_iou": "IoU", "false_positives": "false alarms",
    "best_f1": "best F1", "best_score": "at score", "misses": "missed",
    "mota": "MOTA", "idf1": "IDF1", "hota": "HOTA", "id_switches": "switches",
    "false_tracks": "false tracks", "mean_delay": "delay", "right": "right class",
    "confused": "confused with",
}  # fmt: skip
"""Headings of columns that differ from the name of the attribute."""


@dataclass(frozen=True, slots=True)
class Counting:
    """The rule for which boxes count.

    Attributes
    ----------
    score
        Detections with at least this score count.
    min_width
        Vehicles narrower than this fraction of the image's width are ignore regions, and narrower
        detections count only if they match a vehicle.
    scores
        The minimum scores of classes for which it is not `score`.
    """

    score: float
    min_width: float
    scores: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredImage:
    """A searched image, compared with its labels like a video of one frame.

    Attributes
    ----------
    every, shown
        The vehicles compared with the detections of every score, and with those that count.
    """

    labelled: LabelledImage
    every: Comparison
    shown: Comparison

    @classmethod
    def of(cls, image: LabelledImage, width: int, boxes: Boxes, counting: Counting) -> Self:
        """Compare the detections with the labels of an image, `width` pixels wide."""
        minimum = counting.min_width * width
        truth = [
            replace(label, id=number, ignored=label.ignored or label.box.width < minimum)
            for number, label in enumerate(image.labels)
        ]
        is_labelled = [name not in image.unlabelled for name in boxes.class_names]
        boxes = boxes[np.flatnonzero(is_labelled)]
        boxes = boxes[np.argsort(-boxes.scores, kind="stable")[:_MAX_DETECTIONS]]
        detected = [
            Track(
                *(number, found.box, found.score, "detected", found.class_name),
                ignored=found.box.width < minimum,
            )
            for number, found in enumerate(boxes)
        ]
        shown = list(compress(detected, boxes.reach(counting.score, counting.scores)))
        every, counted = (compare_frames({0: labels}, {0: truth}) for labels in (detected, shown))
        return cls(image, every, counted)


@dataclass(frozen=True)
class ImageScores(DetectionScores):
    """The scores of one source, or their mean over sources.

    The mean has the sums of all counts, and the means of the ratios over the sources with vehicles.

    Attributes
    ----------
    images, vehicles
        Counts.
    ap50, ap50_95
        Average precision over all scores.
    best_f1, best_score
        The highest F1 at any score, and that score; 0 without vehicles or detections. The mean uses
        one score for all sources.
    """

    images: int
    vehicles: int
    ap50: float
    ap50_95: float
    best_f1: float
    best_score: float


@dataclass(frozen=True, eq=False)
class MeasuredSet:
    """The images of one source, labelled and measured."""

    labelled: LabelledImages
    images: Sequence[MeasuredImage]

    @cached_property
    def ranked(self) -> RankedPredictions:
        """The detections of every score."""
        return rank_predictions(pool([image.every for image in self.images]))

    @cached_property
    def scores(self) -> ImageScores:
        """The scores of the source."""
        detection = score_boxes(pool([image.shown for image in self.images]))
        ap50, ap50_95 = self.ranked.average_precisions()
        best, at_score = best_f1([self.ranked])
        return ImageScores(
            **vars(detection),
            images=len(self.images),
            vehicles=self.ranked.vehicles,
            ap50=ap50,
            ap50_95=ap50_95,
            best_f1=best,
            best_score=at_score,
        )


def mean_scores(sources: Sequence[MeasuredSet]) -> ImageScores:
    """Return the mean over sources."""
    scores = [source.scores for source in sources]
    with_vehicles = [score for score in scores if score.vehicles] or scores
    means: dict[str, Any] = {}
    for name in (column.name for column in fields(ImageScores)):
        total = sum(getattr(score, name) for score in scores)
        ratios = [getattr(score, name) for score in with_vehicles]
        means[name] = total if isinstance(total, int) else fmean(ratios)
    best, at_score = best_f1([source.ranked for source in sources])
    return ImageScores(**means | {"best_f1": best, "best_score": at_score})


def evaluate_images(
    sets: Sequence[LabelledImages],
    model: DetectorModel,
    counting: Counting,
    *,
    threads: int = 1,
    progress: Progress = no_progress,
) -> list[MeasuredSet]:
    """Search all images, each on its own, and score each set.

    Parameters
    ----------
    model
        A detector that returns detections of every score, or at least of `counting.score`.
    progress
        Called once, with the number of images, for the progress.

    Raises
    ------
    ImageError
        An image cannot be read or searched; the message names it.
    """
    advance = progress("", sum(len(set_.images) for set_ in sets))
    whole = ImageSearch(model, Settings())  # the whole image, without steps

    def search(labelled: LabelledImage) -> MeasuredImage:
        image = labelled.read()
        detections = whole.detect(labelled.path, image).detections
        return MeasuredImage.of(labelled, image.shape[1], detections, counting)

    sources = []
    for labelled in sets:
        measured = []
        with SearchThreads(threads) as pool:
            for _, result in pool.map_ordered(search, labelled.images):
                measured.append(result)
                advance(1)
        sources.append(MeasuredSet(labelled, measured))
    return sources


def best_f1(sources: Sequence[RankedPredictions]) -> tuple[float, float]:
    """Return the highest mean F1 at any one score, and that score; 0 without vehicles."""
    sources = [ranked for ranked in sources if ranked.vehicles and len(ranked.scores)]
    if not sources:
        return 0.0, 0.0
    scores = np.unique(np.concatenate([ranked.scores for ranked in sources]))[::-1]
    means = np.mean([ranked.f1_at(scores) for ranked in sources], axis=0)
    return float(means.max()), float(scores[np.argmax(means)])


@dataclass(frozen=True, eq=False)
class ClipResult:
    """One video compared with its ground truth, or several videos pooled.

    `name` is shown in tables; `video` is the file, None if a file of tracks is scored. Frames up to
    `until`, counted from 1, are compared.
    """

    name: str
    comparison: Comparison
    until: int = 0
    video: Path | None = None

    @cached_property
    def scores(self) -> Scores:
        """All metrics."""
        return score_comparison(self.comparison)


def total(clips: Sequence[ClipResult]) -> ClipResult:
    """Return the pooled result of all videos."""
    return ClipResult("total", pool([clip.comparison for clip in clips]))


def score_files(
    prediction: Path, truth_path: Path, until: int | None = None, settings: Settings = _DEFAULT
) -> ClipResult:
    """Score a file of tracks against a file of ground truth.

    Parameters
    ----------
    until
        Number of the last frame to use, from 1; None: the last that the truth covers.
    settings
        For the classes to detect, and the roles of labels.

    Raises
    ------
    TruthError
        A file cannot be used.
    """
    tracks = read_tracks(prediction)
    for finding in warnings_in(tracks.findings):
        _log.warning("%s: %s", prediction, finding)
    truth = read_truth(truth_path, Roles.from_settings(settings))
    end = until or truth.length
    return ClipResult(str(prediction), compare(tracks.until(end), truth.until(end)), end)


def evaluate_video(
    video: Path,
    truth: SavedTracks,
    settings: Settings,
    model: DetectorModel,
    *,
    progress: Progress = no_progress,
    until: int | None = None,
) -> ClipResult:
    """Find the vehicles in a video with `vdet.run.video.Results`, and score them.

    True vehicles outside the regions are ignored.

    Parameters
    ----------
    truth
        Its ground truth; later frames are not read.
    model
        The detector of the settings.
    progress
        Called once, for the progress.
    until
        Number of the last frame to use, from 1; None: the last that the truth covers.

    Raises
    ------
    VideoError
        The video cannot be read or searched.
    TruthError
        The truth covers frames beyond the end of the video.
    """
    all_classes = settings.model_copy(update={"classes": ()})
    run = Run(video, settings=all_classes, frames=until or truth.length or None)
    shown, frames = dict[int, list[Track]](), 0
    truth = truth.until(until) if until else truth
    with Results(run, Parts(model), with_traffic=False) as results:
        advance, info = progress("", results.reader.expected), results.reader.info
        for result in results:
            tracks = [replace(track, box=track.box.rounded) for track in result.tracks]
            shown |= {result.frame.index: tracks} if tracks else {}
            frames += 1
            advance(1)
    truth.check_end(video, frames)
    truth = truth.until(frames)
    if settings.regions:
        regions = Regions(settings.regions, info.width, info.height)
        true_frames = {
            index: [
                replace(track, ignored=track.ignored or not regions.contains(track.foot))
                for track in tracks
            ]
            for index, tracks in truth.frames.items()
        }
        truth = replace(truth, frames=true_frames)
    comparison = compare(SavedTracks(shown), truth)
    return ClipResult(str(video), comparison, frames, video)


@dataclass(frozen=True, slots=True)
class RunName:
    """The measured detector: kind, model file, settings and changes to them."""

    detector: str
    model: Path | None
    config: str | None
    assignments: tuple[str, ...] = ()

    @property
    def line(self) -> str:
        """The description as a line of text."""
        model = f", model {self.model.name}" if self.model else ""
        settings = " ".join([self.config or "default", *self.assignments])
        return f"vdet {__version__}, detector {self.detector}{model}, settings {settings}"

    @property
    def values(self) -> dict[str, Any]:
        """The description as values for JSON."""
        model = self.model and str(self.model)
        return {"program": f"vdet {__version__}", **asdict(self), "model": model}


def figure(value: float | str | None, digits: int = 3) -> str:
    """Format a text, a count, or a ratio with some digits; a dash for None."""
    if value is None:
        return "–"
    return str(value) if isinstance(value, int | str) else f"{value:.{digits}f}"


def table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return a table as lines of text, the first column left-aligned, the others right-aligned.

    Parameters
    ----------
    headings
        One per column.
    rows
        One text per column each.
    """
    widths = [max(map(len, column)) for column in zip(headings, *rows, strict=True)]
    form = "  ".join(f"{{:{'>' if number else '<'}{width}}}" for number, width in enumerate(widths))
    return [form.format(*row).rstrip() for row in (headings, *rows)]


@dataclass(frozen=True, slots=True)
class Tile:
    """A BGR uint8 image with a title and a caption below it."""

    image: Image
    title: str
    caption: str


def worst_tiles(source: MeasuredSet) -> Iterator[Tile]:
    """Yield the images with the most mistakes.

    Raises `ImageError` if an image can no longer be read.
    """
    scored = [(score_boxes(image.shown), image) for image in source.images]
    scored.sort(key=lambda pair: -pair[0].false_positives - pair[0].misses)
    for scores, image in scored[:_MAX_IMAGES]:
        if scores.false_positives or scores.misses:
            drawn = _with_boxes(image.labelled.read(), image.shown.frames[0])
            alarms = quantity(scores.false_positives, "false alarm")
            yield Tile(drawn, image.labelled.path.name, f"{scores.misses} missed, {alarms}")


def _mistakes(comparison: Comparison) -> dict[str, list[_Mistake]]:
    """Return the boxes of each missed vehicle and of each false alarm, by its name."""
    boxes: dict[str, list[_Mistake]] = defaultdict(list)
    for frame in comparison.frames:
        overlaps = frame.iou.max(axis=1, initial=0)
        for row in np.setdiff1d(np.arange(len(frame.vehicles)), frame.rows).tolist():
            name = f"missed vehicle {comparison.vehicle_ids[frame.vehicles[row]]}"
            boxes[name].append((frame, frame.vehicle_boxes[row], overlaps[row]))
        overlaps = frame.iou.max(axis=0, initial=0)
        for row in np.setdiff1d(np.arange(len(frame.tracks)), frame.columns).tolist():
            name = f"false alarm, track {comparison.track_ids[frame.tracks[row]]}"
            boxes[name].append((frame, frame.track_boxes[row], overlaps[row]))
    return boxes


def mistake_tiles(video: Path, comparison: Comparison) -> Iterator[Tile]:
    """Yield the middle frame of the largest mistakes, cut around the box.

    The video is decoded again. Raises `VideoError`.
    """
    mistakes = sorted(_mistakes(comparison).items(), key=lambda item: -len(item[1]))[:_MAX_CROPS]
    middles = [boxes[(len(boxes) - 1) // 2] for _, boxes in mistakes]
    numbers = {frame.number for frame, _, _ in middles}
    tolerant = InputSettings(max_damaged=1)  # it was accepted when it was scored
    with VideoReader(video, frames=max(numbers, default=0) + 1, settings=tolerant) as reader:
        images = {frame.index: frame.image for frame in reader if frame.index in numbers}
    for (name, boxes), (frame, box, _) in zip(mistakes, middles, strict=True):
        if frame.number in images:
            overlap = sum(overlap for _, _, overlap in boxes) / len(boxes)
            caption = f"{quantity(len(boxes), 'frame')}, best IoU {overlap:.2f}"
            tile = _cut_around(box, _with_boxes(images[frame.number], frame))
            yield Tile(tile, f"{name}, frame {frame.number + 1}", caption)


def _cut_around(sides: Float64Array, image: Image) -> Image:
    box = Box.of(sides)
    x, y = box.center
    height, width = image.shape[:2]
    part_width = max(_SCALE * max(box.width, box.height), width / 8)
    part = Box.sized(x - part_width / 2, y - part_width / 3, part_width, part_width / 1.5)
    return part.clipped(width, height).cut(image)


def _with_boxes(image: Image, frame: ComparedFrame) -> Image:
    drawn, line = image.copy(), 1 + image.shape[1] // 700
    for boxes, color in ((frame.vehicle_boxes, TRUE), (frame.track_boxes, DETECTED)):
        for x1, y1, x2, y2 in boxes.round().astype(int).tolist():
            cv2.rectangle(drawn, (x1, y1), (x2, y2), color, line)
    return drawn


@dataclass(frozen=True, slots=True)
class Report:
    """The results of an evaluation.

    Attributes
    ----------
    lines
        Text: the measured detector, tables with the scores first, and notes.
    values
        Values for JSON.
    sheets
        Images of mistakes by the name of their source, made with the page.
    """

    lines: list[str]
    values: Mapping[str, Any]
    sheets: Sequence[tuple[str, Iterable[Tile]]] = ()

    def page(self) -> str:
        """Return a page as HTML: the lines and the images.

        Raises `ImageError` or `VideoError` if a source can no longer be read.
        """
        return render("eval.html", report=self, sheets=[(n, list(t)) for n, t in self.sheets])


def _joined(*parts: Sequence[str]) -> list[str]:
    """Return the parts that are not empty, with an empty line between them."""
    return [line for part in parts if part for line in ("", *part)][1:]


def images_report(measured: Sequence[MeasuredSet], counting: Counting, name: RunName) -> Report:
    """Report the scores of labelled images: a row for each source, and their mean."""
    mean = mean_scores(measured)
    classes = class_results(pool([image.shown for source in measured for image in source.images]))
    rows = [(source.labelled.name, source.scores) for source in measured]
    sources = [
        {"source": title, **asdict(scores), "not_vehicles": dict(source.labelled.omitted)}
        for source, (title, scores) in zip(measured, rows, strict=True)
    ]
    if len(rows) > 1:
        with_vehicles = sum(scores.vehicles > 0 for _, scores in rows)
        rows.append((f"mean of {with_vehicles}", mean))
    width = f"; vehicles from {counting.min_width:.1%} of the width" if counting.min_width else ""
    lines = _joined(
        [name.line, f"boxes from score {counting.score:.2f}{width}"],
        _score_table("source", _OF_IMAGES, rows),
        _class_table(classes),
        [_omitted(source) for source in measured if source.labelled.omitted],
    )
    values = {"mean": asdict(mean), "sources": sources, "classes": list(map(asdict, classes))}
    sheets = [(source.labelled.name, worst_tiles(source)) for source in measured]
    return Report(lines, {**name.values, **asdict(counting), **values}, sheets)


def video_report(clips: Sequence[ClipResult], name: RunName) -> Report:
    """Report the scores of labelled videos: a row for each, and the total of several."""
    return _clips_report(clips, name.line, name.values)


def tracks_report(clip: ClipResult, truth: Path) -> Report:
    """Report the scores of a file of tracks."""
    report = _clips_report([clip], f"compared with {truth} by vdet {__version__}", {})
    (values,), classes = report.values["videos"], report.values["classes"]
    return replace(report, values=values | {"classes": classes})


def _clips_report(clips: Sequence[ClipResult], title: str, facts: Mapping[str, Any]) -> Report:
    rows = [*clips, total(clips)] if len(clips) > 1 else clips
    classes = class_results(rows[-1].comparison)
    lines = _joined(
        [title],
        _score_table("video", _OF_VIDEO, [(clip.name, clip.scores) for clip in rows]),
        _class_table(classes),
        [f"{clip.name}: frames 1–{clip.until} compared" for clip in clips],
    )
    values = {
        "total": asdict(rows[-1].scores),
        "classes": list(map(asdict, classes)),
        "videos": [{"video": c.name, "until": c.until, **asdict(c.scores)} for c in clips],
    }
    videos = [(clip, clip.video) for clip in clips if clip.video]
    sheets = [(clip.name, mistake_tiles(video, clip.comparison)) for clip, video in videos]
    return Report(lines, {**facts, **values}, sheets)


def _score_table(title: str, columns: Sequence[str], named: Sequence[_Named]) -> list[str]:
    """Return a table of named scores; `title` is the heading of the names."""
    headings = [title, *(_HEADINGS.get(column, column) for column in columns)]
    rows = [[name, *(figure(getattr(scores, key)) for key in columns)] for name, scores in named]
    return table(headings, rows) if rows else []


def _class_table(classes: Iterable[ClassResult]) -> list[str]:
    """Return a row for each class."""
    return _score_table("class", _OF_CLASSES, [(class_.name, class_) for class_ in classes])


def _omitted(source: MeasuredSet) -> str:
    """Return the labels that are not vehicles, as a line."""
    named = ", ".join(
        f"{printable(name)} ({count})" for name, count in source.labelled.omitted.items()
    )
    return f"not vehicles in {source.labelled.name}: {named}"
