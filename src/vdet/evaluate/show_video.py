"""The results of an evaluation in video: lines of text, values for JSON, and a page."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from vdet.boxes import Box, Image
from vdet.config.schema import InputSettings
from vdet.errors import counted
from vdet.evaluate.comparison import Comparison
from vdet.evaluate.output import ABSENT, RunName, Table, score_table, share, table
from vdet.evaluate.tiles import FOUND, TRUE, Tile, draw_tile
from vdet.evaluate.timelines import Stretch
from vdet.evaluate.video import ClipResult, RunResult, best
from vdet.media.reader import VideoReader
from vdet.pages.charts import BAD, FILL, Span, Timeline, number_axis
from vdet.pages.render import render

COLUMNS = (
    *(("precision", "precision"), ("recall", "recall"), ("F1", "f1"), ("AP50", "ap50")),
    *(("AP50:95", "ap50_95"), ("IoU", "mean_iou"), ("MOTA", "mota"), ("IDF1", "idf1")),
    *(("HOTA", "hota"), ("switches", "id_switches"), ("false tracks", "false_tracks")),
)
"""The headings of the scores, and the attribute of `Scores` below each."""
_LARGEST = 10  # mistakes that are listed for a video

_DETAILS = """\
boxes: {vehicle_boxes} true ones (vehicles: {vehicles}); {matches} found, {misses} missed, \
{alarms}
tracks: {tracks}, {false_tracks} of them false{per_minute}; {switches}, {breaks}
vehicles: {mostly_tracked} mostly tracked, {partly_tracked} partly, {mostly_lost} mostly lost, \
{never_found} never found; first shown {delay} after they appear, on average, and \
for {excess} after they leave
also: MOTP {motp:.3f}, IDP {idp:.3f}, IDR {idr:.3f}, DetA {deta:.3f}, AssA {assa:.3f}"""

_TILE_WIDTH, _TILE_ASPECT = 330, 1.5
_MOST_TILES = 24
_CROP_SCALE = 2.4  # size of the crop, in sizes of the box


def result_lines(runs: Sequence[RunResult]) -> Iterator[str]:
    """Yield runs as lines: one run in full, several (a sweep) with a row each."""
    top = best(runs)
    if len(runs) > 1:
        yield from table(*sweep_table(runs))
        yield ""
        yield f"best F1: {_setting(top)} ({share(top.total.f1)})"
        return
    yield from table(*clip_table(top))
    yield ""
    yield from detail_lines(top)
    for clip in top.clips:
        if clip.mistakes:
            yield ""
            yield f"largest of {counted(len(clip.mistakes), 'mistake')} in {clip.name}"
            yield from table(*mistake_table(clip))


def clip_table(run: RunResult) -> Table:
    """Return a row for each video, and one for the total of several."""
    named = [(clip.name, clip.scores) for clip in run.clips]
    total = [("total", run.total)] if len(named) > 1 else []
    return score_table("video", COLUMNS, [*named, *total])


def sweep_table(runs: Sequence[RunResult]) -> Table:
    """Return a row for the total of each run."""
    return score_table("setting", COLUMNS, [(_setting(run), run.total) for run in runs])


def _setting(run: RunResult) -> str:
    return " ".join(run.assignments)


def detail_lines(run: RunResult) -> list[str]:
    """Return which frames were compared, and the numbers that are in no table."""
    total = run.total
    rate = total.false_tracks_per_minute
    details = _DETAILS.format(
        **asdict(total),
        alarms=counted(total.false_positives, "false alarm"),
        switches=counted(total.id_switches, "id switch"),
        breaks=counted(total.fragmentations, "fragmentation"),
        delay=_mean_frames(total.mean_delay),
        excess=_mean_frames(total.mean_excess),
        per_minute="" if rate is None else f" ({rate:.1f} a minute)",
    )
    return [*map(_frames_line, run.clips), *details.splitlines()]


def _mean_frames(mean: float | None) -> str:
    return ABSENT if mean is None else f"{mean:.1f} frames"


def _frames_line(clip: ClipResult) -> str:
    boxes = counted(clip.left_out, "box")
    left_out = f"; left out: {boxes} found in later ones" if clip.left_out else ""
    return f"{clip.name}: frames 1–{clip.until} compared{left_out}"


def mistake_table(clip: ClipResult) -> Table:
    """Return the largest mistakes."""
    return ("what", "frames", "boxes", "best IoU"), [
        [_name(each), _frame_span(each), str(each.boxes), share(each.overlap, 2)]
        for each in clip.mistakes[:_LARGEST]
    ]


def _name(mistake: Stretch) -> str:
    missed = mistake.kind == "missed"
    return f"vehicle {mistake.id} missed" if missed else f"false alarm, track {mistake.id}"


def _frame_span(mistake: Stretch) -> str:
    return f"{mistake.first}–{mistake.last}" if mistake.boxes > 1 else str(mistake.first)


def plain(runs: Sequence[RunResult], name: RunName) -> dict[str, Any]:
    """Return runs as values for JSON.

    Beside the detector, one run has `total` and `videos`; several have these each, with their
    `settings`, in `sweep`.
    """
    results: list[dict[str, Any]] = []
    for run in runs:
        settings = dict(text.split("=", 1) for text in run.assignments)
        videos = [{"video": clip.name, **plain_clip(clip)} for clip in run.clips]
        results.append({"settings": settings, "total": asdict(run.total), "videos": videos})
    if len(results) > 1:
        return name.values() | {"sweep": results}
    del results[0]["settings"]
    return name.values() | results[0]


def plain_clip(clip: ClipResult) -> dict[str, Any]:
    """Return the scores of a video and its mistakes as values for JSON."""
    lost = [{**asdict(mistake), "boxes": mistake.boxes} for mistake in clip.mistakes]
    for each in lost:
        del each["partner"]
    frames = {"until": clip.until, "left_out": clip.left_out}
    return {**asdict(clip.scores), **frames, "mistakes": lost}


def video_page(runs: Sequence[RunResult], what: str) -> str:
    """Return the page as HTML; of a sweep, only the best setting is shown in full.

    `what` says what was measured. Raises `VideoError` if a video can no longer be read for its
    pictures.
    """
    top = best(runs)
    best_of = f"; best of {len(runs)} settings: {_setting(top)}" if len(runs) > 1 else ""
    headings, rows = clip_table(top)
    return render(
        "eval_video.html",
        subtitle=f"{', '.join(clip.name for clip in top.clips)}; {what}{best_of}",
        figures=list(zip(headings, rows[-1], strict=True))[1:],
        videos=(headings, rows) if len(top.clips) > 1 else None,
        details=detail_lines(top),
        sweep=sweep_table(runs) if len(runs) > 1 else None,
        best=runs.index(top),
        clips=[
            (clip.name, _timeline(clip), mistake_table(clip), mistake_tiles(clip))
            for clip in top.clips
        ],
    )


def _timeline(clip: ClipResult) -> Timeline:
    """Return the chart of found and missed vehicles and false alarms over time."""
    ids = clip.comparison.vehicle_ids.tolist()
    rows = {id_: row for row, id_ in enumerate(ids)}
    spans = []
    for each in clip.stretches:
        alarm = each.kind == "false alarm"
        color, label = (BAD, "") if each.partner is None else (FILL, f"#{each.partner}")
        title = f"{_name(each) if alarm else each.kind}: {each.first}–{each.last}"
        row = len(ids) if alarm else rows[each.id]
        spans.append(Span(row, each.first - 0.5, each.last + 0.5, title, color, label=label))
    names = [*(f"vehicle {id_}" for id_ in ids), "false alarms"]
    axis = number_axis(0, max(1, clip.until) + 0.5, "frame", fixed=True)
    return Timeline("When each vehicle was found", axis, spans, names)


def mistake_tiles(clip: ClipResult) -> list[Tile]:
    """Return the middle frame of the largest mistakes, cropped around the box.

    The video is decoded again. The list is empty if there is no video. Raises `VideoError`.
    """
    chosen = clip.mistakes[:_MOST_TILES]
    if clip.video is None or not chosen:
        return []
    images = _frames(clip.video, {mistake.middle for mistake in chosen})
    tiles = []
    for mistake in (each for each in chosen if each.middle in images):
        image = _cropped(images[mistake.middle], mistake, clip.comparison)
        caption = f"{_frame_span(mistake)}: best IoU {mistake.overlap:.2f}"
        tiles.append(Tile(image, f"{_name(mistake)}, frame {mistake.middle}", caption))
    return tiles


def _frames(video: Path, numbers: set[int]) -> dict[int, Image]:
    tolerant = InputSettings(max_damaged=1)  # it was accepted when it was scored
    with VideoReader(video, frames=max(numbers), settings=tolerant) as reader:
        return {frame.index + 1: frame.image for frame in reader if frame.index + 1 in numbers}


def _cropped(image: Image, mistake: Stretch, comparison: Comparison) -> Image:
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
