"""Reports of evaluations: as text, as values for JSON, and as a page with the mistakes."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from vdet.boxes import Box, Float64Array, Image
from vdet.config.schema import InputSettings
from vdet.draw.boxes import Color
from vdet.errors import counted, printable
from vdet.evaluate.comparison import ComparedFrame, Comparison
from vdet.evaluate.images import ImagesResult, MeasuredSet
from vdet.evaluate.output import RunName, figure, table
from vdet.evaluate.scores import ClassResult, class_results, score_boxes
from vdet.evaluate.video import ClipResult, total
from vdet.media.reader import VideoReader
from vdet.pages.render import Table, render
from vdet.version import __version__

TRUE: Color = (90, 220, 60)
FOUND: Color = (40, 120, 255)

_MAX_IMAGES, _MAX_CROPS = 9, 24  # of each source; of each video
_SCALE = 3.0  # width of the part around a box, in sizes of the box

_Seen = tuple[int, Float64Array, float]
"""Number of a frame with a mistake, the box, and its best IoU with any box of the other side."""


@dataclass(frozen=True, slots=True)
class Mistake:
    """Consecutive frames in which a vehicle is missed, or a track is a false alarm.

    Attributes
    ----------
    what
        `missed vehicle` or `false alarm, track`.
    id
        Id of the true vehicle, or of the track.
    first, middle, last
        Numbers of frames, from 1.
    boxes
        Number of boxes.
    box
        x1, y1, x2, y2 in the middle frame, pixels.
    overlap
        Mean over the frames of the best IoU with any box of the other side. Near 0: no such box.
        Below 0.5: a poor fit. Above: the other box is matched with another one.
    """

    what: str
    id: int
    first: int
    middle: int
    last: int
    boxes: int
    box: tuple[float, ...]
    overlap: float

    @property
    def name(self) -> str:
        """The mistake, as text."""
        return f"{self.what} {self.id}"

    @property
    def span(self) -> str:
        """The first and the last frame, as text."""
        return f"{self.first}–{self.last}" if self.boxes > 1 else str(self.first)


def mistakes(comparison: Comparison) -> tuple[Mistake, ...]:
    """Return all mistakes, the longest first.

    Frames in which a vehicle or a track does not count are not mistakes, and split a mistake.
    """
    seen: dict[tuple[str, int], list[_Seen]] = defaultdict(list)
    for frame in comparison.frames:
        missed = comparison.vehicle_ids[frame.vehicles], frame.vehicle_boxes, frame.iou, frame.rows
        false = comparison.track_ids[frame.tracks], frame.track_boxes, frame.iou.T, frame.columns
        for what, sides in (("missed vehicle", missed), ("false alarm, track", false)):
            ids, boxes, iou, paired = sides
            for row in np.setdiff1d(np.arange(len(ids)), paired).tolist():
                overlap = float(iou[row].max(initial=0))
                seen[what, int(ids[row])].append((frame.number, boxes[row], overlap))
    found = []
    for (what, id_), frames in seen.items():
        # Consecutive frames have a constant difference between number and position.
        runs = groupby(enumerate(frames), lambda placed: placed[1][0] - comparison.step * placed[0])
        found += [_mistake(what, id_, [item for _, item in run]) for _, run in runs]
    return tuple(sorted(found, key=lambda one: (-one.boxes, one.first, one.what, one.id)))


def _mistake(what: str, id_: int, frames: Sequence[_Seen]) -> Mistake:
    (first, *_), (last, *_) = frames[0], frames[-1]
    middle, box, _ = frames[(len(frames) - 1) // 2]
    overlap = sum(frame[2] for frame in frames) / len(frames)
    return Mistake(what, id_, first, middle, last, len(frames), tuple(box.tolist()), overlap)


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
            (frame,), labelled = image.shown.frames, image.labelled
            alarms = counted(scores.false_positives, "false alarm")
            caption = f"{scores.misses} missed, {alarms}"
            yield Tile(_with_boxes(labelled.read(), frame), labelled.path.name, caption)


def mistake_tiles(video: Path, comparison: Comparison) -> Iterator[Tile]:
    """Yield the middle frame of the largest mistakes, cut around the box.

    The video is decoded again. Raises `VideoError`.
    """
    frames = {frame.number: frame for frame in comparison.frames}
    for mistake, image in _middle_frames(video, mistakes(comparison)[:_MAX_CROPS]):
        box = Box(*mistake.box)
        x, y = box.center
        width = max(_SCALE * max(box.width, box.height), image.shape[1] / 8)
        part = Box.sized(x - width / 2, y - width / 3, width, width / 1.5)
        drawn = _with_boxes(image, frames[mistake.middle])
        tile = part.clipped(image.shape[1], image.shape[0]).cut(drawn)
        caption = f"{mistake.span}: best IoU {mistake.overlap:.2f}"
        yield Tile(tile, f"{mistake.name}, frame {mistake.middle}", caption)


def _middle_frames(video: Path, chosen: Sequence[Mistake]) -> list[tuple[Mistake, Image]]:
    wanted = {mistake.middle for mistake in chosen}
    tolerant = InputSettings(max_damaged=1)  # it was accepted when it was scored
    with VideoReader(video, frames=max(wanted, default=1), settings=tolerant) as reader:
        images = {frame.index + 1: frame.image for frame in reader if frame.index + 1 in wanted}
    return [(mistake, images[mistake.middle]) for mistake in chosen if mistake.middle in images]


def _with_boxes(image: Image, frame: ComparedFrame) -> Image:
    drawn, line = image.copy(), 1 + image.shape[1] // 700
    for boxes, color in ((frame.vehicle_boxes, TRUE), (frame.track_boxes, FOUND)):
        for x1, y1, x2, y2 in boxes.round().astype(int).tolist():
            cv2.rectangle(drawn, (x1, y1), (x2, y2), color, line)
    return drawn


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

_MAX_MISTAKES = 10  # listed for a video


@dataclass(frozen=True, slots=True)
class Report:
    """The results of an evaluation.

    Attributes
    ----------
    head, tables, notes
        The measured detector; tables, scores first; further lines of text.
    values
        Values for JSON.
    sheets
        Images of mistakes by the name of their source, made with the page.
    """

    head: Sequence[str]
    tables: Sequence[Table]
    notes: Sequence[str]
    values: Mapping[str, Any]
    sheets: Sequence[tuple[str, Iterable[Tile]]] = ()

    def lines(self) -> list[str]:
        """Return everything except the images as text, with empty lines between parts."""
        tables = (table(*item) for item in self.tables if item[1])
        parts = filter(None, (self.head, *tables, self.notes))
        return [line for part in parts for line in ("", *part)][1:]

    def page(self) -> str:
        """Return a page as HTML; the last row of the scores is at the top.

        Raises `ImageError` or `VideoError` if a source can no longer be read.
        """
        return render("eval.html", report=self, sheets=[(n, list(t)) for n, t in self.sheets])


def images_report(result: ImagesResult, name: RunName) -> Report:
    """Report the scores of labelled images: a row for each source, and their mean."""
    rows = [(source.labelled.name, source.scores) for source in result.sources]
    sources = [
        {"source": title, **asdict(scores), "not_vehicles": dict(source.labelled.others)}
        for source, (title, scores) in zip(result.sources, rows, strict=True)
    ]
    mean, counting, classes = result.mean, result.counting, class_results(result.comparison)
    if len(rows) > 1:
        known = sum(scores.vehicles > 0 for _, scores in rows)
        rows.append((f"mean of {known}", mean))
    width = f"; vehicles from {counting.min_width:.1%} of the width"
    what = f"boxes from score {counting.score:.2f}{width if counting.min_width else ''}"
    values = {"mean": asdict(mean), "sources": sources, "classes": list(map(asdict, classes))}
    return Report(
        [name.line, what],
        [_score_table("source", _OF_IMAGES, rows), _class_table(classes)],
        [_others(source) for source in result.sources if source.labelled.others],
        {**name.values, **asdict(counting), **values},
        [(source.labelled.name, worst_tiles(source)) for source in result.sources],
    )


def video_report(clips: Sequence[ClipResult], name: RunName) -> Report:
    """Report the scores of labelled videos: a row for each, and the total of several."""
    return _clips_report(clips, name.line, name.values)


def tracks_report(clip: ClipResult, truth: Path) -> Report:
    """Report the scores of a file of tracks."""
    report = _clips_report([clip], f"compared with {truth} by vdet {__version__}", {})
    (values,), classes = report.values["videos"], report.values["classes"]
    return replace(report, values=values | {"classes": classes})


def _clips_report(clips: Sequence[ClipResult], what: str, facts: Mapping[str, Any]) -> Report:
    rows = [*clips, total(clips)] if len(clips) > 1 else clips
    classes = class_results(rows[-1].comparison)
    values = {
        "total": asdict(rows[-1].scores),
        "classes": list(map(asdict, classes)),
        "videos": list(map(_clip_values, clips)),
    }
    scores = [(clip.name, clip.scores) for clip in rows]
    tables = [
        _score_table("video", _OF_VIDEO, scores),
        _class_table(classes),
        *map(_mistake_table, clips),
    ]
    notes = [f"{clip.name}: frames 1–{clip.until} compared" for clip in clips]
    sheets = [
        (clip.name, mistake_tiles(clip.video, clip.comparison)) for clip in clips if clip.video
    ]
    return Report([what], tables, notes, {**facts, **values}, sheets)


def _clip_values(clip: ClipResult) -> dict[str, Any]:
    wrong = list(map(asdict, mistakes(clip.comparison)))
    return {"video": clip.name, "until": clip.until, **asdict(clip.scores), "mistakes": wrong}


def _score_table(first: str, columns: Sequence[str], named: Iterable[tuple[str, object]]) -> Table:
    """Return a table of named scores; `first` is the heading of the names."""
    headings = [first, *(_HEADINGS.get(column, column) for column in columns)]
    rows = [[name, *(figure(getattr(scores, key)) for key in columns)] for name, scores in named]
    return headings, rows


def _class_table(classes: Iterable[ClassResult]) -> Table:
    """Return a row for each class."""
    return _score_table("class", _OF_CLASSES, [(class_.name, class_) for class_ in classes])


def _mistake_table(clip: ClipResult) -> Table:
    """Return the largest mistakes."""
    return (f"worst errors in {clip.name}", "frames", "boxes", "best IoU"), [
        [mistake.name, mistake.span, str(mistake.boxes), figure(mistake.overlap, 2)]
        for mistake in mistakes(clip.comparison)[:_MAX_MISTAKES]
    ]


def _others(source: MeasuredSet) -> str:
    """Return the labels that are not vehicles, as a line."""
    named = ", ".join(f"{printable(name)} ({count})" for name, count in source.labelled.others)
    return f"not vehicles in {source.labelled.name}: {named}"
