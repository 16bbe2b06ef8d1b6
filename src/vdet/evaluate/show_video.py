"""The results of an evaluation in video: lines of text, values for JSON, and a page."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from vdet.boxes import Box
from vdet.config.schema import InputSettings
from vdet.evaluate.comparison import Comparison
from vdet.evaluate.output import ABSENT, FOUND, TRUE, RunName, Tile, draw_tile, share, table
from vdet.evaluate.scores import Scores
from vdet.evaluate.timelines import Mistake
from vdet.evaluate.video import ClipResult, RunResult, best
from vdet.media import VideoReader
from vdet.media.images import Image
from vdet.pages.charts import BAD, FILL, Span, Timeline, number_axis
from vdet.pages.render import render

HEADINGS = (
    *("precision", "recall", "F1", "AP50", "AP50:95", "IoU"),
    *("MOTA", "IDF1", "HOTA", "switches", "false tracks"),
)
MISTAKE_HEADINGS = ("what", "frames", "boxes", "best IoU")
_LARGEST = 10  # mistakes that are listed for a video

_DETAILS = """\
boxes: {vehicle_boxes} true ones (vehicles: {vehicles}); {matches} found, {misses} missed, \
{false_positives} false alarms
tracks: {tracks}, {false_tracks} of them false{per_minute}; {id_switches} id switches, \
{fragmentations} fragmentations
vehicles: {mostly_tracked} mostly tracked, {partly_tracked} partly, {mostly_lost} mostly lost, \
{never_found} never found; mean time to the first detection {delay}
also: MOTP {motp:.3f}, IDP {idp:.3f}, IDR {idr:.3f}, DetA {deta:.3f}, AssA {assa:.3f}"""

_TILE_WIDTH, _TILE_ASPECT = 330, 1.5
_MOST_TILES = 24
_CROP_SCALE = 2.4  # size of the crop, in sizes of the box


def result_lines(runs: Sequence[RunResult]) -> Iterator[str]:
    """Yield runs as lines: one run in full, several (a sweep) with a row each."""
    top = best(runs)
    if len(runs) > 1:
        yield from table(("setting", *HEADINGS), sweep_rows(runs))
        yield ""
        yield f"best F1: {_setting(top)} ({share(top.total.f1)})"
        return
    yield from table(("video", *HEADINGS), clip_rows(top))
    yield ""
    yield from detail_lines(top)
    for clip in top.clips:
        if clip.mistakes:
            yield ""
            yield f"largest of {len(clip.mistakes)} mistakes in {clip.name}"
            yield from table(MISTAKE_HEADINGS, mistake_rows(clip))


def key_figures(scores: Scores) -> list[str]:
    """Return the texts under `HEADINGS`."""
    found = (scores.precision, scores.recall, scores.f1, scores.ap50, scores.ap50_95)
    followed = (scores.mean_iou, scores.mota, scores.idf1, scores.hota)
    return [*map(share, (*found, *followed)), str(scores.id_switches), str(scores.false_tracks)]


def clip_rows(run: RunResult) -> list[list[str]]:
    """Return a row of text for each video, and one for the total of several."""
    rows = [[clip.name, *key_figures(clip.scores)] for clip in run.clips]
    return [*rows, ["total", *key_figures(run.total)]] if len(rows) > 1 else rows


def sweep_rows(runs: Sequence[RunResult]) -> list[list[str]]:
    """Return a row of text for the total of each run."""
    return [[_setting(run), *key_figures(run.total)] for run in runs]


def _setting(run: RunResult) -> str:
    return " ".join(run.assignments)


def detail_lines(run: RunResult) -> list[str]:
    """Return which frames were compared, and the numbers that are not key figures."""
    delay, rate = run.total.mean_delay, run.total.false_tracks_per_minute
    details = _DETAILS.format(
        **asdict(run.total),
        delay=ABSENT if delay is None else f"{delay:.1f} frames",
        per_minute="" if rate is None else f" ({rate:.1f} a minute)",
    )
    return [*map(_frames_line, run.clips), *details.splitlines()]


def _frames_line(clip: ClipResult) -> str:
    left_out = f"; left out: {clip.left_out} boxes found in later ones" if clip.left_out else ""
    return f"{clip.name}: frames 1–{clip.until} compared{left_out}"


def mistake_rows(clip: ClipResult) -> list[list[str]]:
    """Return the texts of the largest mistakes under `MISTAKE_HEADINGS`."""
    return [
        [_name(each), _frame_span(each), str(each.boxes), share(each.overlap, 2)]
        for each in clip.mistakes[:_LARGEST]
    ]


def _name(mistake: Mistake) -> str:
    missed = mistake.kind == "missed"
    return f"vehicle {mistake.id} missed" if missed else f"false alarm, track {mistake.id}"


def _frame_span(mistake: Mistake) -> str:
    return f"{mistake.first}–{mistake.last}" if mistake.boxes > 1 else str(mistake.first)


def plain(runs: Sequence[RunResult], name: RunName) -> dict[str, Any]:
    """Return runs as values for JSON.

    Beside the detector, one run has `total` and `videos`; several have these each, with their
    `settings`, in `sweep`.
    """
    results = [
        {
            "settings": dict(text.split("=", 1) for text in run.assignments),
            "total": asdict(run.total),
            "videos": [{"video": clip.name, **plain_clip(clip)} for clip in run.clips],
        }
        for run in runs
    ]
    if len(results) > 1:
        return name.values() | {"sweep": results}
    del results[0]["settings"]
    return name.values() | results[0]


def plain_clip(clip: ClipResult) -> dict[str, Any]:
    """Return the scores of a video and its mistakes as values for JSON."""
    lost = [{**asdict(mistake), "boxes": mistake.boxes} for mistake in clip.mistakes]
    frames = {"until": clip.until, "left_out": clip.left_out}
    return {**asdict(clip.scores), **frames, "mistakes": lost}


def video_page(runs: Sequence[RunResult], what: str) -> str:
    """Return the page as HTML; of a sweep, only the best setting is shown in full.

    `what` says what was measured. Raises `VideoError` if a video can no longer be read for its
    pictures.
    """
    top = best(runs)
    best_of = f"; best of {len(runs)} settings: {_setting(top)}" if len(runs) > 1 else ""
    return render(
        "eval_video.html",
        subtitle=f"{', '.join(clip.name for clip in top.clips)}; {what}{best_of}",
        figures=list(zip(HEADINGS, key_figures(top.total), strict=True)),
        headings=HEADINGS,
        rows=clip_rows(top) if len(top.clips) > 1 else [],
        details=detail_lines(top),
        sweep_rows=sweep_rows(runs) if len(runs) > 1 else [],
        best=runs.index(top),
        mistake_headings=MISTAKE_HEADINGS,
        clips=[
            (clip.name, _timeline(clip), mistake_rows(clip), mistake_tiles(clip))
            for clip in top.clips
        ],
    )


def _timeline(clip: ClipResult) -> Timeline:
    """Return when each vehicle was found and by which track, when missed, and the false alarms."""
    spans = [
        _span(
            row, each.first, each.last, each.partner, "missed" if each.partner is None else "found"
        )
        for row, timeline in enumerate(clip.timelines)
        for each in timeline.stretches
    ]
    spans += [
        _span(len(clip.timelines), each.first, each.last, None, _name(each))
        for each in clip.mistakes
        if each.kind == "false alarm"
    ]
    names = [*(f"vehicle {timeline.id}" for timeline in clip.timelines), "false alarms"]
    axis = number_axis(0, max(1, clip.until) + 0.5, "frame", fixed=True)
    return Timeline("When each vehicle was found", axis, spans, names)


def _span(row: int, first: int, last: int, track: int | None, what: str) -> Span:
    color, label = (BAD, "") if track is None else (FILL, f"#{track}")
    return Span(row, first - 0.5, last + 0.5, f"{what}: {first}–{last}", color, label=label)


def mistake_tiles(clip: ClipResult) -> list[Tile]:
    """Return the middle frame of the largest mistakes, cropped around the box.

    The video is decoded again. The list is empty if there is no video. Raises `VideoError`.
    """
    chosen = clip.mistakes[:_MOST_TILES]
    if clip.video is None or not chosen:
        return []
    images = _frames(clip.video, {mistake.middle for mistake in chosen})
    return [
        Tile(
            _cropped(images[mistake.middle], mistake, clip.comparison),
            f"{_name(mistake)}, frame {mistake.middle}",
            f"{_frame_span(mistake)}: best IoU {mistake.overlap:.2f}",
        )
        for mistake in chosen
        if mistake.middle in images
    ]


def _frames(video: Path, numbers: set[int]) -> dict[int, Image]:
    tolerant = InputSettings(max_damaged=1)  # it was accepted when it was scored
    with VideoReader(video, frames=max(numbers), settings=tolerant) as reader:
        return {frame.index + 1: frame.image for frame in reader if frame.index + 1 in numbers}


def _cropped(image: Image, mistake: Mistake, comparison: Comparison) -> Image:
    """Return the part of a frame around the box of a mistake."""
    (frame,) = (each for each in comparison.frames if each.number == mistake.middle)
    if mistake.kind == "missed":
        boxes = frame.vehicle_boxes[comparison.vehicle_ids[frame.vehicles] == mistake.id]
    else:
        boxes = frame.track_boxes[comparison.track_ids[frame.tracks] == mistake.id]
    box = Box(*boxes[0].tolist())
    rows, columns = image.shape[:2]
    width = max(_CROP_SCALE * max(box.width, box.height * _TILE_ASPECT), columns / 8)
    height = width / _TILE_ASPECT
    x, y = box.center
    part = Box.sized(x - width / 2, y - height / 2, width, height).clipped(columns, rows)
    outlines = (frame.vehicle_boxes, TRUE, 3), (frame.track_boxes, FOUND, 2)
    return draw_tile(image, part, _TILE_WIDTH, *outlines)
