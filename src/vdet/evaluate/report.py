"""How the results of evaluations are shown: as text, as values for JSON, and on pages."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, astuple
from pathlib import Path
from typing import Any, NamedTuple

from vdet.boxes import Box, Image
from vdet.config.schema import InputSettings
from vdet.errors import counted, printable
from vdet.evaluate.comparison import Comparison
from vdet.evaluate.images import SIZE_NAMES, ImageScores, ImagesResult, MeasuredImage, MeasuredSet
from vdet.evaluate.output import ABSENT, RunName, figure, share, table
from vdet.evaluate.scores import score_detections
from vdet.evaluate.tiles import FOUND, IGNORED, TRUE, Tile, draw_tile
from vdet.evaluate.timelines import Stretch
from vdet.evaluate.video import ClipResult, RunResult, best
from vdet.media.reader import VideoReader
from vdet.pages.charts import BAD, FILL, SOFT, Line, Plot, Span, Timeline, color, curve, number_axis
from vdet.pages.render import render
from vdet.version import __version__

OF_PICTURES = (
    *(("pictures", "images"), ("vehicles", "vehicles"), ("precision", "precision")),
    *(("recall", "recall"), ("F1", "f1"), ("AP50", "ap50"), ("AP50:95", "ap50_95")),
    *(("IoU", "mean_iou"), ("false alarms", "false_positives")),
    *(("best F1", "best_f1"), ("at score", "best_score")),
)
"""The headings of the scores of pictures, and the attribute of `ImageScores` below each."""

OF_VIDEO = (
    *(("precision", "precision"), ("recall", "recall"), ("F1", "f1"), ("AP50", "ap50")),
    *(("AP50:95", "ap50_95"), ("IoU", "mean_iou"), ("MOTA", "mota"), ("IDF1", "idf1")),
    *(("HOTA", "hota"), ("switches", "id_switches"), ("false tracks", "false_tracks")),
)
"""The headings of the scores of video, and the attribute of `Scores` below each."""

_DETAILS = """\
boxes: {vehicle_boxes} true ones (vehicles: {vehicles}); {matches} found, {misses} missed, \
{alarms}
tracks: {tracks}, {false_tracks} of them false{per_minute}; {switches}, {breaks}
vehicles: {mostly_tracked} mostly tracked, {partly_tracked} partly, {mostly_lost} mostly lost, \
{never_found} never found; first shown {delay} after they appear, on average, and \
for {excess} after they leave
also: MOTP {motp:.3f}, IDP {idp:.3f}, IDR {idr:.3f}, DetA {deta:.3f}, AssA {assa:.3f}"""

_MOST_OTHERS = 8  # labels that are named
_MOST_MISTAKES = 10  # listed for a video
_MOST_PICTURES, _PICTURE_WIDTH = 9, 480  # of each source; pixels
_MOST_CROPS, _CROP_WIDTH = 24, 330  # of each video; pixels
_CROP_ASPECT, _CROP_SCALE = 1.5, 2.4  # the scale in sizes of the box

Table = tuple[Sequence[str], Sequence[Sequence[str]]]
"""Headings and rows of text."""


class Report(NamedTuple):
    """The results of an evaluation: lines of text, values for JSON, and a page as HTML.

    The page raises `ImageError` or `VideoError` if what it shows can no longer be read.
    """

    lines: Sequence[str]
    values: Mapping[str, Any]
    page: Callable[[], str]


def images_report(result: ImagesResult, run: RunName) -> Report:
    """Show the scores of labelled pictures: a row for each source, and one for their mean."""
    named = [(source.labelled.name, source.scores) for source in result.sources]
    mean, known = result.mean, sum(scores.vehicles > 0 for _, scores in named)
    rows = [*named, (f"mean of {known}", mean)] if len(named) > 1 else named
    head = [*run.lines(), _counting_line(result)]
    scores = _score_table("source", OF_PICTURES, rows)
    tables = [each for each in (_size_table(rows), _class_table(result)) if each[1]]
    notes = [line for source in result.sources for line in _others(source)]
    sources = []
    for source in result.sources:
        others = {"not_vehicles": dict(source.labelled.others)}
        sources.append({"source": source.labelled.name, **asdict(source.scores), **others})
    classes = list(map(asdict, result.classes()))
    measured = {"mean": asdict(mean), "sources": sources, "classes": classes}
    values = {**run.values(), **asdict(result.counting), **measured}

    def page() -> str:
        sheets = [(source.labelled.name, worst_tiles(source)) for source in result.sources]
        parts = {"plot": _f1_plot(result), "tables": tables, "sheets": sheets}
        return _page("eval_images.html", "; ".join(head), scores, notes, **parts)

    lines = _paragraphs(head, *(table(*each) for each in (scores, *tables)), notes)
    return Report(lines, values, page)


def video_report(runs: Sequence[RunResult], name: RunName) -> Report:
    """Show one run, or a sweep. For JSON, a sweep has the `settings` of each run, in `sweep`."""
    results: list[dict[str, Any]] = []
    for run in runs:
        settings = dict(text.split("=", 1) for text in run.assignments)
        videos = [{"video": clip.name, **_clip_values(clip)} for clip in run.clips]
        results.append({"settings": settings, "total": asdict(run.total), "videos": videos})
    if len(results) > 1:
        results = [{"sweep": results}]
    else:
        del results[0]["settings"]
    what = "; ".join(name.lines())
    lines = [*name.lines(), *result_lines(runs)]
    return Report(lines, {**name.values(), **results[0]}, lambda: _video_page(runs, what))


def tracks_report(run: RunResult, truth: Path) -> Report:
    """Show the scores of a file of tracks."""
    what = f"compared with {truth} by vdet {__version__}"
    return Report(result_lines([run]), _clip_values(run.clips[0]), lambda: _video_page([run], what))


def result_lines(runs: Sequence[RunResult]) -> list[str]:
    """Return runs as lines: one run in full, several (a sweep) with a row each."""
    top = best(runs)
    if len(runs) > 1:
        best_line = f"best F1: {_setting(top)} ({share(top.total.f1)})"
        return _paragraphs(table(*_sweep_table(runs)), [best_line])
    mistakes = []
    for clip in top.clips:
        if count := len(clip.mistakes):
            heading = f"largest of {counted(count, 'mistake')} in {clip.name}"
            mistakes.append([heading, *table(*_mistake_table(clip))])
    return _paragraphs(table(*_clip_table(top)), _details(top), *mistakes)


def _paragraphs(*blocks: Sequence[str]) -> list[str]:
    """Return the lines of all blocks, with an empty one between two."""
    lines: list[str] = []
    for block in filter(None, blocks):
        lines += ["", *block] if lines else block
    return lines


def _page(template: str, what: str, scores: Table, notes: Sequence[str], **parts: Any) -> str:
    """Return a page; the last row of the scores stands on top."""
    headings, rows = scores
    figures = list(zip(headings, rows[-1], strict=True))[1:]
    return render(template, subtitle=what, figures=figures, scores=scores, notes=notes, **parts)


def _score_table(
    first: str, columns: Sequence[tuple[str, str]], named: Iterable[tuple[str, object]]
) -> Table:
    """Return a table of scores and their names; `first` is the heading of the names."""
    rows = [[name, *(figure(getattr(each, key)) for _, key in columns)] for name, each in named]
    return (first, *(heading for heading, _ in columns)), rows


def _counting_line(result: ImagesResult) -> str:
    counting = result.counting
    text = f"boxes from score {counting.score:.2f}"
    if counting.least_width:
        text += f"; vehicles from {counting.least_width:.1%} of the width"
    return text


def _size_table(named: Iterable[tuple[str, ImageScores]]) -> Table:
    """Return recall and F1 by the width of the vehicles."""
    rows = []
    for name, scores in named:
        cells = (
            f"{share(size.recall, 2)} / {share(size.f1, 2)}" if size.vehicles else ABSENT
            for size in scores.sizes
        )
        rows.append([name, *cells])
    return ("recall / F1 by width", *SIZE_NAMES), rows


def _class_table(result: ImagesResult) -> Table:
    """Return a row for each class: its scores, and the number found by the class given."""
    headings, rows = ["class", "vehicles", "precision", "recall", "F1"], []
    for name, *scores, named in map(astuple, result.classes()):
        headings[5:] = [f"as {each}" for each in named]
        rows.append([name, *map(figure, (*scores, *named.values()))])
    return headings, rows


def _others(source: MeasuredSet) -> Iterator[str]:
    """Yield a line if there are labels that are not vehicles."""
    labelled = source.labelled
    if labelled.others:
        shown = labelled.others[:_MOST_OTHERS]
        named = ", ".join(f"{printable(name)} ({count})" for name, count in shown)
        more = ", …" if len(labelled.others) > _MOST_OTHERS else ""
        yield f"not vehicles in {labelled.name}: {named}{more}"


def _f1_plot(result: ImagesResult) -> Plot:
    score = result.counting.score
    colored = [(each, color(number)) for number, each in enumerate(result.sources)]
    lines = [curve(*each.ranked.f1_curve(), one) for each, one in colored]
    lines.append(Line([(score, 0), (score, 1)], SOFT, dashed=True))
    legend = [(each.labelled.name, one) for each, one in colored]
    title = "F1 by the lowest score that counts (dashed: here)"
    return Plot(title, number_axis(0, 1, "score"), number_axis(0, 1), (), lines, legend)


def worst_tiles(source: MeasuredSet) -> list[Tile]:
    """Return the pictures with the most mistakes among what counts, with all boxes.

    Raises `ImageError` if a picture can no longer be read.
    """
    scored = [(image, score_detections(image.shown)) for image in source.images]
    scored.sort(key=lambda each: -each[1].misses - each[1].false_positives)
    tiles = []
    for image, scores in scored[:_MOST_PICTURES]:
        if scores.misses or scores.false_positives:
            caption = f"{scores.misses} missed, {counted(scores.false_positives, 'false alarm')}"
            tiles.append(Tile(_drawn(image), image.picture.path.name, caption))
    return tiles


def _drawn(image: MeasuredImage) -> Image:
    picture = image.picture.read()
    outlines = [(image.regions, IGNORED, 1)]
    for frame in image.shown.frames:
        outlines += [(frame.vehicle_boxes, TRUE, 2), (frame.track_boxes, FOUND, 1)]
    height, width = picture.shape[:2]
    return draw_tile(picture, Box(0, 0, width, height), _PICTURE_WIDTH, *outlines)


def _clip_table(run: RunResult) -> Table:
    """Return a row for each video, and one for the total of several."""
    named = [(clip.name, clip.scores) for clip in run.clips]
    total = [("total", run.total)] if len(named) > 1 else []
    return _score_table("video", OF_VIDEO, [*named, *total])


def _sweep_table(runs: Sequence[RunResult]) -> Table:
    """Return a row for the total of each run."""
    return _score_table("setting", OF_VIDEO, [(_setting(run), run.total) for run in runs])


def _setting(run: RunResult) -> str:
    return " ".join(run.assignments)


def _details(run: RunResult) -> list[str]:
    """Return which frames were compared, and the numbers that are in no table."""
    lines = []
    for clip in run.clips:
        boxes = counted(clip.left_out, "box")
        left_out = f"; left out: {boxes} found in later ones" if clip.left_out else ""
        lines.append(f"{clip.name}: frames 1–{clip.until} compared{left_out}")
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
    return [*lines, *details.splitlines()]


def _mean_frames(mean: float | None) -> str:
    return ABSENT if mean is None else f"{mean:.1f} frames"


def _mistake_table(clip: ClipResult) -> Table:
    """Return the largest mistakes."""
    return ("what", "frames", "boxes", "best IoU"), [
        [each.name, each.span, str(each.boxes), share(each.overlap, 2)]
        for each in clip.mistakes[:_MOST_MISTAKES]
    ]


def _clip_values(clip: ClipResult) -> dict[str, Any]:
    """Return the scores of a video and its mistakes as values for JSON."""
    lost = [{**asdict(mistake), "boxes": mistake.boxes} for mistake in clip.mistakes]
    for each in lost:
        del each["partner"]
    frames = {"until": clip.until, "left_out": clip.left_out}
    return {**asdict(clip.scores), **frames, "mistakes": lost}


def _video_page(runs: Sequence[RunResult], what: str) -> str:
    """Return the page as HTML; of a sweep, only the best setting is shown in full."""
    top = best(runs)
    names = ", ".join(clip.name for clip in top.clips)
    best_of = f"; best of {len(runs)} settings: {_setting(top)}" if len(runs) > 1 else ""
    return _page(
        "eval_video.html",
        f"{names}; {what}{best_of}",
        _clip_table(top),
        _details(top),
        sweep=_sweep_table(runs) if len(runs) > 1 else None,
        best=runs.index(top),
        clips=[
            (clip.name, _timeline(clip), _mistake_table(clip), mistake_tiles(clip))
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
        title = f"{each.name if alarm else each.kind}: {each.first}–{each.last}"
        row = len(ids) if alarm else rows[each.id]
        spans.append(Span(row, each.first - 0.5, each.last + 0.5, title, color, label=label))
    names = [*(f"vehicle {id_}" for id_ in ids), "false alarms"]
    axis = number_axis(0, max(1, clip.until) + 0.5, "frame", fixed=True)
    return Timeline("When each vehicle was found", axis, spans, names)


def mistake_tiles(clip: ClipResult) -> list[Tile]:
    """Return the middle frame of the largest mistakes, cropped around the box.

    The video is decoded again. The list is empty if there is no video. Raises `VideoError`.
    """
    chosen = clip.mistakes[:_MOST_CROPS]
    if clip.video is None or not chosen:
        return []
    images = _frames(clip.video, {mistake.middle for mistake in chosen})
    return [
        Tile(
            _cropped(images[each.middle], each, clip.comparison),
            f"{each.name}, frame {each.middle}",
            f"{each.span}: best IoU {each.overlap:.2f}",
        )
        for each in chosen
        if each.middle in images
    ]


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
    width = max(_CROP_SCALE * max(box.width, box.height * _CROP_ASPECT), columns / 8)
    height = width / _CROP_ASPECT
    x, y = box.center
    part = Box.sized(x - width / 2, y - height / 2, width, height).clipped(columns, rows)
    outlines = (frame.vehicle_boxes, TRUE, 3), (frame.track_boxes, FOUND, 2)
    return draw_tile(image, part, _CROP_WIDTH, *outlines)
