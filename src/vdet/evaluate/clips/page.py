"""The page on detection and tracking in videos."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from vdet.config.schema import InputSettings
from vdet.evaluate.clips.evaluate import ClipResult, RunResult, best
from vdet.evaluate.clips.losses import Loss, LossKind
from vdet.evaluate.clips.text import (
    HEADINGS,
    LARGEST,
    clip_rows,
    detail_lines,
    frame_span,
    frames_line,
    loss_name,
    loss_row,
    setting_name,
    sweep_rows,
)
from vdet.evaluate.comparison import pool
from vdet.evaluate.detection_metrics import IOU_THRESHOLDS, average_precisions
from vdet.evaluate.output import share
from vdet.evaluate.scores import Scores
from vdet.evaluate.tiles import FOUND, TRUE, Outlines, Tile, draw_tile
from vdet.media import VideoReader
from vdet.media.images import Image
from vdet.pages.charts import BAD, FILL, Line, Plot, Span, Timeline, color, number_axis
from vdet.pages.render import render

_SHAPE = 330, 220  # of a picture, pixels
_MOST_PICTURES = 12  # of each kind of loss
_CROP_SCALE = 2.4  # size of the crop, in sizes of the box
_MOST_LINES = 12  # more could not be told apart in a legend


@dataclass(frozen=True, slots=True)
class _Clip:
    """What the page shows of one video."""

    name: str
    timeline: Timeline
    first_detections: list[list[str]]
    losses: list[list[str]]
    missed: list[Tile]
    alarms: list[Tile]


def video_page(runs: Sequence[RunResult], what: str) -> str:
    """Return the page as HTML; of a sweep, only the best setting is shown in full.

    `what` says what was measured. Raises `VideoError` if a video can no longer be read for its
    pictures.
    """
    top = best(runs)
    best_of = f"; best of {len(runs)} settings: {setting_name(top)}" if len(runs) > 1 else ""
    return render(
        "eval_video.html",
        subtitle=f"{', '.join(clip.name for clip in top.clips)}; {what}{best_of}",
        figures=_key_figures(top.total),
        headings=HEADINGS,
        rows=list(clip_rows(top)),
        details=[*map(frames_line, top.clips), *detail_lines(top.total)],
        sweep=_sweep(runs, top) if len(runs) > 1 else None,
        sweep_rows=sweep_rows(runs),
        best=runs.index(top),
        clips=[_clip(clip) for clip in top.clips],
        tightness=_tightness(top),
    )


def _key_figures(scores: Scores) -> list[tuple[str, str]]:
    return [
        ("precision", share(scores.precision)),
        ("recall", share(scores.recall)),
        ("F1 at IoU 0.5", share(scores.f1)),
        ("MOTA", share(scores.mota)),
        ("IDF1", share(scores.idf1)),
        ("HOTA", share(scores.hota)),
        ("id switch" if scores.id_switches == 1 else "id switches", str(scores.id_switches)),
        ("false track" if scores.false_tracks == 1 else "false tracks", str(scores.false_tracks)),
    ]


def _clip(clip: ClipResult) -> _Clip:
    return _Clip(
        clip.name,
        _timeline(clip),
        [
            [
                f"vehicle {first.vehicle}",
                str(first.appears),
                "never" if first.found is None else str(first.found),
                share(first.delay, 0),
            ]
            for first in clip.scores.first_detections
        ],
        [loss_row(loss) for loss in clip.losses[:LARGEST]],
        loss_tiles(clip, "missed"),
        loss_tiles(clip, "false alarm"),
    )


def _timeline(clip: ClipResult) -> Timeline:
    """Return when each vehicle was found and by which track, when missed, and the false alarms."""
    spans = []
    for row, timeline in enumerate(clip.timelines):
        for each in timeline.stretches:
            found = each.track is not None
            label = f"#{each.track}" if found else ""
            title = f"{f'track {each.track}' if found else 'missed'}: {each.first}–{each.last}"
            ends = each.first - 0.5, each.last + 0.5
            spans.append(Span(row, *ends, title, FILL if found else BAD, label=label))
    for loss in clip.losses:
        if loss.kind == "false alarm":
            title = f"{loss_name(loss)}: {frame_span(loss)}"
            row, ends = len(clip.timelines), (loss.first - 0.5, loss.last + 0.5)
            spans.append(Span(row, *ends, title, BAD))
    names = [f"vehicle {timeline.vehicle}" for timeline in clip.timelines]
    last = max([1.0, *(span.last for span in spans)])
    axis = number_axis(0, last, "frame", fixed=True)
    return Timeline("when each vehicle was found", axis, spans, [*names, "false alarms"])


def _sweep(runs: Sequence[RunResult], top: RunResult) -> Plot:
    """Draw a line along the values of the first key for each combination of the others."""
    groups: dict[str, list[RunResult]] = {}
    for run in runs:
        groups.setdefault(" ".join(run.assignments[1:]), []).append(run)
    lines = [
        Line(
            [_point(run) for run in along],
            color(number),
            dots=True,
            labels=[run.assignments[0].partition("=")[2] for run in along if top in along],
        )
        for number, along in enumerate(groups.values())
    ]
    lines.append(Line([_point(top)], BAD, dots=True))
    legend = [(name, color(number)) for number, name in enumerate(groups) if name]
    recalls, precisions = zip(*map(_point, runs), strict=True)
    return Plot(
        "precision and recall of each setting",
        number_axis(min(recalls), max(recalls), "recall", least=0.01),
        number_axis(min(precisions), max(precisions), "precision", least=0.01),
        lines=lines,
        legend=[*legend[:_MOST_LINES], ("best F1", BAD)],
        title=f"Precision by recall, along {top.assignments[0].partition('=')[0]}",
    )


def _point(run: RunResult) -> tuple[float, float]:
    return run.total.recall, run.total.precision


def _tightness(run: RunResult) -> Plot:
    values = average_precisions(pool([clip.comparison for clip in run.clips]))
    points = list(zip(IOU_THRESHOLDS, map(float, values), strict=True))
    x = number_axis(0.5, 0.95, "required IoU", fixed=True)
    title = "Average precision by IoU"
    return Plot(title, x, number_axis(0, 1), lines=[Line(points, dots=True)], title=title)


def loss_tiles(clip: ClipResult, kind: LossKind) -> list[Tile]:
    """Return the middle frame of the largest losses of a kind, cropped around the box.

    The video is decoded again. The list is empty if there is no video. Raises `VideoError`.
    """
    chosen = [loss for loss in clip.losses if loss.kind == kind][:_MOST_PICTURES]
    if clip.video is None or not chosen:
        return []
    images = dict(_frames(clip.video, {loss.middle for loss in chosen}))
    return [
        Tile(
            _cropped(images[loss.middle], loss, clip),
            f"{loss_name(loss)}, frame {loss.middle}",
            f"lost in {frame_span(loss)}, best IoU {loss.overlap:.2f}",
        )
        for loss in chosen
        if loss.middle in images
    ]


def _frames(video: Path, numbers: set[int]) -> Iterator[tuple[int, Image]]:
    tolerant = InputSettings(max_damaged=1)  # it was accepted when it was scored
    with VideoReader(video, frames=max(numbers), settings=tolerant) as reader:
        for frame in reader:
            if frame.index + 1 in numbers:
                yield frame.index + 1, frame.image


def _cropped(image: Image, loss: Loss, clip: ClipResult) -> Image:
    """Return the part of a frame around the box of a loss, with the shape of a tile."""
    comparison = clip.comparison
    (frame,) = (each for each in comparison.frames if each.number == loss.middle)
    if loss.kind == "missed":
        boxes = frame.vehicle_boxes[comparison.vehicle_ids[frame.vehicles] == loss.id]
    else:
        boxes = frame.track_boxes[comparison.track_ids[frame.tracks] == loss.id]
    x, y, width, height = boxes[0].tolist()
    rows, columns = image.shape[:2]
    aspect = _SHAPE[0] / _SHAPE[1]
    wanted = max(_CROP_SCALE * width, _CROP_SCALE * height * aspect, columns / 8)
    across = int(min(wanted, columns, rows * aspect))
    down = min(rows, max(1, round(across / aspect)))
    left = min(max(0, round(x + (width - across) / 2)), columns - across)
    top = min(max(0, round(y + (height - down) / 2)), rows - down)
    outlines = Outlines(frame.vehicle_boxes, TRUE, 3), Outlines(frame.track_boxes, FOUND, 2)
    return draw_tile(image, (left, top), (across, down), _SHAPE[0], *outlines)
