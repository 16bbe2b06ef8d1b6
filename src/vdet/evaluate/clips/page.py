"""The page on detection and tracking in videos."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from vdet.config.schema import InputSettings
from vdet.evaluate.clips import text
from vdet.evaluate.clips.evaluate import ClipResult, RunResult, best
from vdet.evaluate.comparison import pool
from vdet.evaluate.detection_metrics import IOU_THRESHOLDS, average_precisions
from vdet.evaluate.mistakes import Mistake, MistakeKind
from vdet.evaluate.tiles import FOUND, TRUE, Tile, draw_tile
from vdet.media import VideoReader
from vdet.media.images import Image
from vdet.pages.charts import BAD, FILL, Line, Plot, Span, Timeline, color, number_axis
from vdet.pages.render import render

_SHAPE = 330, 220  # of a picture, pixels
_MOST_PICTURES = 12  # of each kind of mistake
_CROP_SCALE = 2.4  # size of the crop, in sizes of the box
_MOST_LINES = 12  # more could not be told apart in a legend


def video_page(runs: Sequence[RunResult], what: str) -> str:
    """Return the page as HTML; of a sweep, only the best setting is shown in full.

    `what` says what was measured. Raises `VideoError` if a video can no longer be read for its
    pictures.
    """
    top = best(runs)
    best_of = f"; best of {len(runs)} settings: {text.setting_name(top)}" if len(runs) > 1 else ""
    return render(
        "eval_video.html",
        subtitle=f"{', '.join(clip.name for clip in top.clips)}; {what}{best_of}",
        figures=list(zip(text.HEADINGS, text.key_figures(top.total), strict=True)),
        headings=text.HEADINGS,
        rows=list(text.clip_rows(top)) if len(top.clips) > 1 else [],
        details=[*map(text.frames_line, top.clips), *text.detail_lines(top.total)],
        sweep=_sweep(runs, top) if len(runs) > 1 else None,
        sweep_rows=text.sweep_rows(runs),
        best=runs.index(top),
        clips=[_clip(clip) for clip in top.clips],
        tightness=_tightness(top),
    )


def _clip(clip: ClipResult) -> dict[str, Any]:
    """Return what the page shows of a video."""
    return {
        "name": clip.name,
        "timeline": _timeline(clip),
        "mistakes": [text.mistake_row(mistake) for mistake in clip.mistakes[: text.LARGEST]],
        "missed": mistake_tiles(clip, "missed"),
        "alarms": mistake_tiles(clip, "false alarm"),
    }


def _timeline(clip: ClipResult) -> Timeline:
    """Return when each vehicle was found and by which track, when missed, and the false alarms."""
    stretches = [
        (row, each.first, each.last, each.track)
        for row, timeline in enumerate(clip.timelines)
        for each in timeline.stretches
    ]
    alarms = [mistake for mistake in clip.mistakes if mistake.kind == "false alarm"]
    bottom = len(clip.timelines)
    spans = [
        *(_span(*stretch, "missed" if stretch[3] is None else "found") for stretch in stretches),
        *(
            _span(bottom, mistake.first, mistake.last, None, text.mistake_name(mistake))
            for mistake in alarms
        ),
    ]
    names = [*(f"vehicle {timeline.vehicle}" for timeline in clip.timelines), "false alarms"]
    axis = number_axis(0, max(1, clip.until) + 0.5, "frame", fixed=True)
    return Timeline("When each vehicle was found", axis, spans, names)


def _span(row: int, first: int, last: int, track: int | None, what: str) -> Span:
    color, label = (BAD, "") if track is None else (FILL, f"#{track}")
    return Span(row, first - 0.5, last + 0.5, f"{what}: {first}–{last}", color, label=label)


def _sweep(runs: Sequence[RunResult], top: RunResult) -> Plot:
    """Draw a line along the values of the first key for each combination of the others."""
    groups: dict[str, list[RunResult]] = {}
    for run in runs:
        groups.setdefault(" ".join(run.assignments[1:]), []).append(run)
    legend = [(name, color(number)) for number, name in enumerate(groups) if name]
    lines = []
    for number, along in enumerate(groups.values()):
        values = [run.assignments[0].partition("=")[2] for run in along if top in along]
        points = [(run.total.recall, run.total.precision) for run in along]
        lines.append(Line(points, color(number), dots=True, labels=values))
    best_point = (top.total.recall, top.total.precision)
    lines.append(Line([best_point], BAD, dots=True))
    recalls, precisions = zip(*(point for line in lines for point in line.points), strict=True)
    title = f"Precision by recall, along {top.assignments[0].partition('=')[0]}"
    x = number_axis(min(recalls), max(recalls), "recall", least=0.01)
    y = number_axis(min(precisions), max(precisions), least=0.01)
    return Plot(title, x, y, (), lines, [*legend[:_MOST_LINES], ("best F1", BAD)])


def _tightness(run: RunResult) -> Plot:
    values = average_precisions(pool([clip.comparison for clip in run.clips]))
    line = Line(list(zip(IOU_THRESHOLDS, map(float, values), strict=True)), dots=True)
    x = number_axis(0.5, 0.95, "required IoU", fixed=True)
    return Plot("Average precision by IoU", x, number_axis(0, 1), lines=[line])


def mistake_tiles(clip: ClipResult, kind: MistakeKind) -> list[Tile]:
    """Return the middle frame of the largest mistakes of a kind, cropped around the box.

    The video is decoded again. The list is empty if there is no video. Raises `VideoError`.
    """
    chosen = [mistake for mistake in clip.mistakes if mistake.kind == kind][:_MOST_PICTURES]
    if clip.video is None or not chosen:
        return []
    images = dict(_frames(clip.video, {mistake.middle for mistake in chosen}))
    return [
        Tile(
            _cropped(images[mistake.middle], mistake, clip),
            f"{text.mistake_name(mistake)}, frame {mistake.middle}",
            f"{text.frame_span(mistake)}: best IoU {mistake.overlap:.2f}",
        )
        for mistake in chosen
        if mistake.middle in images
    ]


def _frames(video: Path, numbers: set[int]) -> Iterator[tuple[int, Image]]:
    tolerant = InputSettings(max_damaged=1)  # it was accepted when it was scored
    with VideoReader(video, frames=max(numbers), settings=tolerant) as reader:
        for frame in reader:
            if frame.index + 1 in numbers:
                yield frame.index + 1, frame.image


def _cropped(image: Image, mistake: Mistake, clip: ClipResult) -> Image:
    """Return the part of a frame around the box of a mistake, with the shape of a tile."""
    comparison = clip.comparison
    (frame,) = (each for each in comparison.frames if each.number == mistake.middle)
    if mistake.kind == "missed":
        boxes = frame.vehicle_boxes[comparison.vehicle_ids[frame.vehicles] == mistake.id]
    else:
        boxes = frame.track_boxes[comparison.track_ids[frame.tracks] == mistake.id]
    x1, y1, x2, y2 = boxes[0].tolist()
    rows, columns = image.shape[:2]
    aspect = _SHAPE[0] / _SHAPE[1]
    wanted = max(_CROP_SCALE * max(x2 - x1, (y2 - y1) * aspect), columns / 8)
    across = int(min(wanted, columns, rows * aspect))
    down = min(rows, max(1, round(across / aspect)))
    left = min(max(0, round((x1 + x2 - across) / 2)), columns - across)
    top = min(max(0, round((y1 + y2 - down) / 2)), rows - down)
    outlines = (frame.vehicle_boxes, TRUE, 3), (frame.track_boxes, FOUND, 2)
    return draw_tile(image, (left, top), (across, down), _SHAPE[0], *outlines)
