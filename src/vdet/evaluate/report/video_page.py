"""The report on detection and tracking in videos."""

from collections.abc import Iterator, Sequence

from vdet.evaluate.clips.evaluate import ClipResult, RunResult, best
from vdet.evaluate.clips.losses import Kind
from vdet.evaluate.clips.text import (
    HEADINGS,
    LARGEST,
    clip_rows,
    detail_lines,
    loss_row,
    setting_name,
    sweep_rows,
)
from vdet.evaluate.report.loss_pictures import TILE, loss_pictures
from vdet.evaluate.report.page import (
    cards,
    charts,
    contact_sheet,
    html_table,
    page,
    paragraph,
    section,
)
from vdet.evaluate.report.video_charts import sweep_chart, tightness_chart, timeline_chart
from vdet.evaluate.scores import Scores
from vdet.evaluate.table import share


def video_page(runs: Sequence[RunResult]) -> str:
    """Return the report as HTML; of a sweep, the best setting is shown in full.

    Needs matplotlib. Raises `VideoError` where a video can no longer be read for its pictures.
    """
    top = best(runs)
    return page("vdet: vehicles in video", _subtitle(top, len(runs)), _sections(runs, top))


def _subtitle(top: RunResult, settings: int) -> str:
    names = ", ".join(clip.name for clip in top.clips)
    return f"{names}; best of {settings} settings: {setting_name(top)}" if settings > 1 else names


def _sections(runs: Sequence[RunResult], top: RunResult) -> Iterator[str]:
    details = map(paragraph, detail_lines(top.total))
    rows = html_table(("video", *HEADINGS), clip_rows(top))
    yield section("In short", cards(_key_figures(top.total)), rows, *details)
    if len(runs) > 1:
        chart = charts([("precision and recall of each setting", sweep_chart(runs))])
        compared = html_table(("setting", *HEADINGS), sweep_rows(runs), best=runs.index(top))
        yield section("Settings compared", chart, compared)
    for clip in top.clips:
        yield section(
            f"Vehicle by vehicle: {clip.name}",
            charts([("timeline of each vehicle", timeline_chart(clip))]),
            *_first_detections(clip.scores),
        )
        yield from _losses(clip)
    yield section(
        "Boxes",
        charts([("average precision by IoU", tightness_chart(top))]),
        paragraph(
            "Tracks carry no probability, so that average precision sums up one working point."
        ),
    )


def _key_figures(scores: Scores) -> list[tuple[str, str]]:
    return [
        ("precision", share(scores.precision)),
        ("recall", share(scores.recall)),
        ("F1 at IoU 0.5", share(scores.f1)),
        ("MOTA", share(scores.mota)),
        ("IDF1", share(scores.idf1)),
        ("HOTA", share(scores.hota)),
        ("id switches", str(scores.id_switches)),
        ("false tracks", str(scores.false_tracks)),
    ]


def _first_detections(scores: Scores) -> Iterator[str]:
    rows = [
        [
            f"vehicle {first.vehicle}",
            str(first.appears),
            "never" if first.found is None else str(first.found),
            share(first.delay, 0),
        ]
        for first in scores.first_detections
    ]
    if rows:
        yield html_table(("", "appears in frame", "first found", "frames until then"), rows)


def _losses(clip: ClipResult) -> Iterator[str]:
    if not clip.losses:
        return
    headings = ("what", "frames", "boxes", "best IoU")
    yield section(
        f"Largest losses: {clip.name}",
        paragraph("Runs of frames with one and the same mistake, the longest first."),
        html_table(headings, [loss_row(loss) for loss in clip.losses[:LARGEST]]),
        *_sheet(clip, "missed", "Missed vehicles: true boxes in green, found ones in orange."),
        *_sheet(clip, "false alarm", "False alarms, in the same colours."),
    )


def _sheet(clip: ClipResult, kind: Kind, legend: str) -> Iterator[str]:
    if pictures := loss_pictures(clip, kind):
        yield paragraph(legend)
        yield contact_sheet(pictures, TILE[0] * 2 // 3)
