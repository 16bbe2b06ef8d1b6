"""Scores of pictures as lines of text, and as plain JSON values."""

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from vdet.evaluate.images.evaluate import ImagesResult
from vdet.evaluate.images.scores import SIZE_NAMES, ImageScores, SizeScores
from vdet.evaluate.output import ABSENT, RunName, plain_run, run_lines, share, table
from vdet.files import printable
from vdet.labels.pictures import LabelledPictures

HEADINGS = (
    *("source", "pictures", "vehicles", "precision", "recall", "F1", "AP50", "AP50:95", "IoU"),
    *("false alarms", "best F1", "at score"),
)
SIZE_HEADINGS = ("recall / F1 by width", *SIZE_NAMES)

_MOST_OTHERS = 8  # labels that are named


def lines(result: ImagesResult, run: RunName) -> Iterator[str]:
    """Yield the detector, what counted, and the scores of each source."""
    yield from run_lines(run)
    yield counting_line(result)
    yield ""
    yield from table(HEADINGS, rows(result))
    yield ""
    yield from table(SIZE_HEADINGS, size_rows(result))
    if others := others_lines(result):
        yield ""
        yield from others


def counting_line(result: ImagesResult) -> str:
    """Return what counted."""
    counting = result.counting
    text = f"boxes from score {counting.score:.2f}"
    if counting.least_width:
        text += f"; vehicles from {counting.least_width:.1%} of the width"
    return text


def rows(result: ImagesResult) -> list[list[str]]:
    """Return the texts under `HEADINGS`: a row for each source, and one for the mean of several."""
    return [[name, *_cells(scores)] for name, scores in result.named]


def size_rows(result: ImagesResult) -> list[list[str]]:
    """Return the texts under `SIZE_HEADINGS`, in the same rows."""
    return [[name, *map(_size_cell, scores.sizes)] for name, scores in result.named]


def others_lines(result: ImagesResult) -> list[str]:
    """Return which labels were taken for no vehicles, a line for each set that has such."""
    return [_others_line(each) for each in result.sets if each.others]


def _others_line(labelled: LabelledPictures) -> str:
    shown = labelled.others[:_MOST_OTHERS]
    named = ", ".join(f"{printable(name)} ({count})" for name, count in shown)
    more = ", …" if len(labelled.others) > _MOST_OTHERS else ""
    return f"not vehicles in {labelled.name}: {named}{more}"


def plain(result: ImagesResult, run: RunName) -> dict[str, Any]:
    """Return all numbers, and what was measured, as values for JSON."""
    return {
        **plain_run(run),
        **asdict(result.counting),
        "mean": _plain_scores(result.mean),
        "sources": [
            {
                "source": labelled.name,
                **_plain_scores(source.scores),
                "not_vehicles": dict(labelled.others),
            }
            for labelled, source in zip(result.sets, result.sources, strict=True)
        ],
    }


def _plain_scores(scores: ImageScores) -> dict[str, Any]:
    sizes = zip(SIZE_NAMES, map(asdict, scores.sizes), strict=True)
    return {**asdict(scores), "sizes": [{"width": name, **size} for name, size in sizes]}


def _size_cell(size: SizeScores) -> str:
    return f"{share(size.recall, 2)} / {share(size.f1, 2)}" if size.vehicles else ABSENT


def _cells(scores: ImageScores) -> list[str]:
    found = (scores.precision, scores.recall, scores.f1, scores.ap50, scores.ap50_95)
    return [
        *(str(scores.images), str(scores.vehicles)),
        *map(share, (*found, scores.mean_iou)),
        str(scores.false_positives),
        *(share(scores.best_f1), share(scores.best_score, 2)),
    ]
