"""How the results of evaluations are shown: as text, as values for JSON, and on a page."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from vdet.errors import printable
from vdet.evaluate.classes import ClassResult, class_results
from vdet.evaluate.images import ImagesResult, MeasuredSet
from vdet.evaluate.mistakes import Tile, mistake_tiles, mistakes, worst_tiles
from vdet.evaluate.output import RunName, figure, share, table
from vdet.evaluate.video import ClipResult, RunResult
from vdet.pages.render import render
from vdet.version import __version__

_OF_BOXES = (
    *(("precision", "precision"), ("recall", "recall"), ("F1", "f1"), ("AP50", "ap50")),
    *(("IoU", "mean_iou"), ("false alarms", "false_positives")),
)
_OF_PICTURES = (
    *(("pictures", "images"), ("vehicles", "vehicles"), *_OF_BOXES),
    *(("best F1", "best_f1"), ("at score", "best_score")),
)
_OF_VIDEO = (
    *(("missed", "misses"), ("MOTA", "mota"), ("IDF1", "idf1"), ("HOTA", "hota")),
    *(("switches", "id_switches"), ("false tracks", "false_tracks"), ("delay", "mean_delay")),
)
"""The headings of scores, and the attributes of `ImageScores` or `Scores` below them."""

_MOST_MISTAKES = 10  # listed for a video

Table = tuple[Sequence[str], Sequence[Sequence[str]]]
"""Headings and rows of text."""


@dataclass(frozen=True, slots=True)
class Report:
    """The results of an evaluation.

    Attributes
    ----------
    head, tables, notes
        What was measured; scores first; lines of text.
    values
        For JSON.
    sheets
        Pictures of mistakes by the name of their source, made when the page is.
    """

    head: Sequence[str]
    tables: Sequence[Table]
    notes: Sequence[str]
    values: Mapping[str, Any]
    sheets: Sequence[tuple[str, Iterable[Tile]]] = ()

    def lines(self) -> list[str]:
        """Return all but the pictures as text, with an empty line between two parts."""
        tables = (table(*item) for item in self.tables if item[1])
        parts = filter(None, (self.head, *tables, self.notes))
        return [line for part in parts for line in ("", *part)][1:]

    def page(self) -> str:
        """Return a page as HTML; the last row of the scores stands on top.

        Raises `ImageError` or `VideoError` if what it shows can no longer be read.
        """
        return render("eval.html", report=self, sheets=[(n, list(t)) for n, t in self.sheets])


def images_report(result: ImagesResult, name: RunName) -> Report:
    """Show the scores of labelled pictures: a row for each source, and one for their mean."""
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
        [_score_table("source", _OF_PICTURES, rows), _class_table(classes)],
        [_others(source) for source in result.sources if source.labelled.others],
        {**name.values, **asdict(counting), **values},
        [(source.labelled.name, worst_tiles(source)) for source in result.sources],
    )


def video_report(runs: Sequence[RunResult], name: RunName) -> Report:
    """Show one run in full, or a row for each of several (a sweep)."""
    if len(runs) == 1:
        return _run_report(runs[0], name.line, name.values | _run_values(runs[0]))
    rows = [(" ".join(run.assignments), run.total.scores) for run in runs]
    best, scores = max(rows, key=lambda row: row[1].f1)
    notes = [f"best F1: {best} ({share(scores.f1)})"]
    sweep = [{"settings": run.assignments, **_run_values(run)} for run in runs]
    swept = _score_table("setting", _OF_BOXES + _OF_VIDEO, rows)
    return Report([name.line], [swept], notes, name.values | {"sweep": sweep})


def tracks_report(result: ClipResult, truth: Path) -> Report:
    """Show the scores of a file of tracks."""
    run, what = RunResult([result]), f"compared with {truth} by vdet {__version__}"
    values = _run_values(run)
    return _run_report(run, what, values["videos"][0] | {"classes": values["classes"]})


def _run_report(run: RunResult, what: str, values: Mapping[str, Any]) -> Report:
    """Show a row of scores for each video and one for the total of several, and the mistakes."""
    clips = dict.fromkeys((*run.clips, run.total))  # of one video, its own result is the total
    rows = [(clip.name, clip.scores) for clip in clips]
    tables = [
        _score_table("video", _OF_BOXES + _OF_VIDEO, rows),
        _class_table(class_results(run.total.comparison)),
        *map(_mistake_table, run.clips),
    ]
    notes = [f"{clip.name}: frames 1–{clip.until} compared" for clip in run.clips]
    sheets = [
        (clip.name, mistake_tiles(clip.video, clip.comparison)) for clip in run.clips if clip.video
    ]
    return Report([what], tables, notes, values, sheets)


def _run_values(run: RunResult) -> dict[str, Any]:
    classes = list(map(asdict, class_results(run.total.comparison)))
    videos = list(map(_clip_values, run.clips))
    return {"total": asdict(run.total.scores), "classes": classes, "videos": videos}


def _clip_values(clip: ClipResult) -> dict[str, Any]:
    wrong = list(map(asdict, mistakes(clip.comparison)))
    return {"video": clip.name, "until": clip.until, **asdict(clip.scores), "mistakes": wrong}


def _score_table(
    first: str, columns: Sequence[tuple[str, str]], named: Iterable[tuple[str, object]]
) -> Table:
    """Return a table of scores and their names; `first` is the heading of the names."""
    rows = [[name, *(figure(getattr(item, key)) for _, key in columns)] for name, item in named]
    return (first, *(heading for heading, _ in columns)), rows


def _class_table(classes: Iterable[ClassResult]) -> Table:
    """Return a row for each class."""
    headings = "class", "vehicles", "found", "named right", "precision", "recall", "F1"
    rows = []
    for class_ in classes:
        counts = (
            class_.vehicles,
            class_.found,
            class_.right,
            class_.precision,
            class_.recall,
            class_.f1,
        )
        wrong = (f"{name} {count}" for name, count in class_.named.items() if name != class_.name)
        rows.append([class_.name, *map(figure, counts), ", ".join(wrong)])
    return (*headings, "confused with"), rows


def _mistake_table(clip: ClipResult) -> Table:
    """Return the largest mistakes."""
    return (f"largest mistakes in {clip.name}", "frames", "boxes", "best IoU"), [
        [mistake.name, mistake.span, str(mistake.boxes), share(mistake.overlap, 2)]
        for mistake in mistakes(clip.comparison)[:_MOST_MISTAKES]
    ]


def _others(source: MeasuredSet) -> str:
    """Return the labels that are not vehicles, as a line."""
    named = ", ".join(f"{printable(name)} ({count})" for name, count in source.labelled.others)
    return f"not vehicles in {source.labelled.name}: {named}"
