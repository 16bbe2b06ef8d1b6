"""The results of an evaluation in pictures: lines of text, values for JSON, and a page."""

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from vdet.boxes import Box
from vdet.evaluate.comparison import Comparison, match
from vdet.evaluate.images import (
    SIZE_NAMES,
    ImageScores,
    ImagesResult,
    MeasuredImage,
    SizeScores,
    Source,
)
from vdet.evaluate.output import (
    ABSENT,
    FOUND,
    IGNORED,
    TRUE,
    RunName,
    Tile,
    draw_tile,
    share,
    table,
)
from vdet.files import printable
from vdet.labels.pictures import LabelledPictures
from vdet.media.images import Image
from vdet.pages.charts import SOFT, Line, Plot, color, curve, number_axis
from vdet.pages.render import counted, render

HEADINGS = (
    *("source", "pictures", "vehicles", "precision", "recall", "F1", "AP50", "AP50:95", "IoU"),
    *("false alarms", "best F1", "at score"),
)
SIZE_HEADINGS = ("recall / F1 by width", *SIZE_NAMES)

_MOST_OTHERS = 8  # labels that are named
_TILE_WIDTH = 480  # pixels
_MOST_TILES = 9  # of each source


def lines(result: ImagesResult, run: RunName) -> Iterator[str]:
    """Yield the detector, what counted, and the scores of each source."""
    yield from run.lines()
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


def _named(result: ImagesResult) -> list[tuple[str, ImageScores]]:
    """Return the name and the scores of each set, and of the mean of several."""
    named = [(source.labelled.name, source.scores) for source in result.sources]
    sets = sum(scores.vehicles > 0 for _, scores in named)
    return [*named, (f"mean of {sets}", result.mean)] if len(named) > 1 else named


def rows(result: ImagesResult) -> list[list[str]]:
    """Return the texts under `HEADINGS`: a row for each source, and one for the mean of several."""
    return [[name, *_cells(scores)] for name, scores in _named(result)]


def size_rows(result: ImagesResult) -> list[list[str]]:
    """Return the texts under `SIZE_HEADINGS`, in the same rows."""
    return [[name, *map(_size_cell, scores.sizes)] for name, scores in _named(result)]


def others_lines(result: ImagesResult) -> list[str]:
    """Return the labels that are not vehicles, a line for each set that has such labels."""
    sets = [source.labelled for source in result.sources]
    return [_others_line(each) for each in sets if each.others]


def _others_line(labelled: LabelledPictures) -> str:
    shown = labelled.others[:_MOST_OTHERS]
    named = ", ".join(f"{printable(name)} ({count})" for name, count in shown)
    more = ", …" if len(labelled.others) > _MOST_OTHERS else ""
    return f"not vehicles in {labelled.name}: {named}{more}"


def plain(result: ImagesResult, run: RunName) -> dict[str, Any]:
    """Return all numbers, and what was measured, as values for JSON."""
    return {
        **run.values(),
        **asdict(result.counting),
        "mean": _plain_scores(result.mean),
        "sources": [
            {
                "source": each.labelled.name,
                **_plain_scores(each.scores),
                "not_vehicles": dict(each.labelled.others),
            }
            for each in result.sources
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


def images_page(result: ImagesResult, run: RunName) -> str:
    """Return the page as HTML. Raises `ImageError` if a picture can no longer be read."""
    score = result.counting.score
    sheets = [(each.labelled.name, worst_tiles(each, score)) for each in result.sources]
    return render(
        "eval_images.html",
        subtitle="; ".join([*run.lines(), counting_line(result)]),
        figures=list(zip(HEADINGS, rows(result)[-1], strict=True))[1:],
        headings=HEADINGS,
        rows=rows(result),
        others=others_lines(result),
        plot=_f1_plot(result),
        size_headings=SIZE_HEADINGS,
        size_rows=size_rows(result),
        sheets=[(name, tiles) for name, tiles in sheets if tiles],
    )


def _f1_plot(result: ImagesResult) -> Plot:
    score = result.counting.score
    colored = [(each, color(number)) for number, each in enumerate(result.sources)]
    lines = [curve(each.curve.scores, each.curve.f1, one) for each, one in colored]
    lines.append(Line([(score, 0), (score, 1)], SOFT, dashed=True))
    legend = [(each.labelled.name, one) for each, one in colored]
    title = "F1 by the lowest score that counts (dashed: here)"
    return Plot(title, number_axis(0, 1, "score"), number_axis(0, 1), (), lines, legend)


def worst_tiles(source: Source, score: float) -> list[Tile]:
    """Return the pictures with the most mistakes at a score, with all boxes.

    Raises `ImageError` if a picture can no longer be read.
    """
    ranked = [(image, *_count(image.compare(score))) for image in source.images]
    ranked.sort(key=lambda each: -each[1] - each[2])
    return [
        Tile(
            _drawn(image, score),
            image.picture.path.name,
            f"{missed} missed, {counted(wrong, 'false alarm')}",
        )
        for image, missed, wrong in ranked[:_MOST_TILES]
        if missed or wrong
    ]


def _count(comparison: Comparison) -> tuple[int, int]:
    """Return the number of missed vehicles and of false alarms."""
    found = sum(map(len, match(comparison)))
    lengths = comparison.vehicle_lengths(), comparison.track_lengths()
    missed, wrong = (int(each.sum()) - found for each in lengths)
    return missed, wrong


def _drawn(image: MeasuredImage, score: float) -> Image:
    picture = image.picture.read()
    outlines = [(image.truth.boxes[image.truth.ignored], IGNORED, 1)]
    for frame in image.compare(score).frames:
        outlines += [(frame.vehicle_boxes, TRUE, 2), (frame.track_boxes, FOUND, 1)]
    height, width = picture.shape[:2]
    return draw_tile(picture, Box(0, 0, width, height), _TILE_WIDTH, *outlines)
