"""The results of an evaluation in pictures: lines of text, values for JSON, and a page."""

from collections.abc import Iterator
from dataclasses import asdict, astuple
from typing import Any

from vdet.boxes import Box, Image
from vdet.errors import counted, printable
from vdet.evaluate import images
from vdet.evaluate.output import ABSENT, RunName, Table, figure, score_table, share, table
from vdet.evaluate.scores import score_detections
from vdet.evaluate.tiles import FOUND, IGNORED, TRUE, Tile, draw_tile
from vdet.pages.charts import SOFT, Line, Plot, color, curve, number_axis
from vdet.pages.render import render

COLUMNS = (
    *(("pictures", "images"), ("vehicles", "vehicles"), ("precision", "precision")),
    *(("recall", "recall"), ("F1", "f1"), ("AP50", "ap50"), ("AP50:95", "ap50_95")),
    *(("IoU", "mean_iou"), ("false alarms", "false_positives")),
    *(("best F1", "best_f1"), ("at score", "best_score")),
)
"""The headings of the scores, and the attribute of `ImageScores` below each."""

_MOST_OTHERS = 8  # labels that are named
_TILE_WIDTH = 480  # pixels
_MOST_TILES = 9  # of each source


def lines(result: images.ImagesResult, run: RunName) -> Iterator[str]:
    """Yield the detector, what counted, and the scores of each source."""
    yield from run.lines()
    yield counting_line(result)
    for headings, rows in (source_table(result), size_table(result), class_table(result)):
        if rows:
            yield ""
            yield from table(headings, rows)
    if others := others_lines(result):
        yield ""
        yield from others


def counting_line(result: images.ImagesResult) -> str:
    """Return the rule for counting as text."""
    counting = result.counting
    text = f"boxes from score {counting.score:.2f}"
    if counting.least_width:
        text += f"; vehicles from {counting.least_width:.1%} of the width"
    return text


def source_table(result: images.ImagesResult) -> Table:
    """Return a row for each source, and one for the mean of several."""
    return score_table("source", COLUMNS, _named(result))


def size_table(result: images.ImagesResult) -> Table:
    """Return recall and F1 by the width of the vehicles, in the same rows."""
    rows = [[name, *map(_size_cell, scores.sizes)] for name, scores in _named(result)]
    return ("recall / F1 by width", *images.SIZE_NAMES), rows


def class_table(result: images.ImagesResult) -> Table:
    """Return a row for each class: its scores, and the number found by the class given."""
    headings, rows = ["class", "vehicles", "precision", "recall", "F1"], []
    for name, *scores, named in map(astuple, result.classes()):
        headings[5:] = [f"as {each}" for each in named]
        rows.append([name, *map(figure, (*scores, *named.values()))])
    return headings, rows


def _named(result: images.ImagesResult) -> list[tuple[str, images.ImageScores]]:
    """Return the name and the scores of each set, and of the mean of several."""
    named = [(source.labelled.name, source.scores) for source in result.sources]
    sets = sum(scores.vehicles > 0 for _, scores in named)
    return [*named, (f"mean of {sets}", result.mean)] if len(named) > 1 else named


def _size_cell(size: images.SizeScores) -> str:
    return f"{share(size.recall, 2)} / {share(size.f1, 2)}" if size.vehicles else ABSENT


def others_lines(result: images.ImagesResult) -> list[str]:
    """Return a line for each set with labels that are not vehicles."""
    found = []
    for labelled in (source.labelled for source in result.sources):
        shown = labelled.others[:_MOST_OTHERS]
        named = ", ".join(f"{printable(name)} ({count})" for name, count in shown)
        more = ", …" if len(labelled.others) > _MOST_OTHERS else ""
        if named:
            found.append(f"not vehicles in {labelled.name}: {named}{more}")
    return found


def plain(result: images.ImagesResult, run: RunName) -> dict[str, Any]:
    """Return all numbers, and what was measured, as values for JSON."""
    sources = []
    for each in result.sources:
        others = {"not_vehicles": dict(each.labelled.others)}
        sources.append({"source": each.labelled.name, **_plain_scores(each.scores), **others})
    scores = {"mean": _plain_scores(result.mean), "sources": sources}
    classes = list(map(asdict, result.classes()))
    return {**run.values(), **asdict(result.counting), **scores, "classes": classes}


def _plain_scores(scores: images.ImageScores) -> dict[str, Any]:
    sizes = zip(images.SIZE_NAMES, map(asdict, scores.sizes), strict=True)
    return {**asdict(scores), "sizes": [{"width": name, **size} for name, size in sizes]}


def images_page(result: images.ImagesResult, run: RunName) -> str:
    """Return the page as HTML. Raises `ImageError` if a picture can no longer be read."""
    headings, rows = source_table(result)
    sheets = [(each.labelled.name, worst_tiles(each)) for each in result.sources]
    return render(
        "eval_images.html",
        subtitle="; ".join([*run.lines(), counting_line(result)]),
        figures=list(zip(headings, rows[-1], strict=True))[1:],
        sources=(headings, rows),
        others=others_lines(result),
        plot=_f1_plot(result),
        tables=[size_table(result), class_table(result)],
        sheets=[(name, tiles) for name, tiles in sheets if tiles],
    )


def _f1_plot(result: images.ImagesResult) -> Plot:
    score = result.counting.score
    colored = [(each, color(number)) for number, each in enumerate(result.sources)]
    lines = [curve(each.curve.scores, each.curve.f1, one) for each, one in colored]
    lines.append(Line([(score, 0), (score, 1)], SOFT, dashed=True))
    legend = [(each.labelled.name, one) for each, one in colored]
    title = "F1 by the lowest score that counts (dashed: here)"
    return Plot(title, number_axis(0, 1, "score"), number_axis(0, 1), (), lines, legend)


def worst_tiles(source: images.MeasuredSet) -> list[Tile]:
    """Return the pictures with the most mistakes among what counts, with all boxes.

    Raises `ImageError` if a picture can no longer be read.
    """
    scored = [(image, score_detections(image.shown)) for image in source.images]
    scored.sort(key=lambda each: -each[1].misses - each[1].false_positives)
    tiles = []
    for image, scores in scored[:_MOST_TILES]:
        if scores.misses or scores.false_positives:
            caption = f"{scores.misses} missed, {counted(scores.false_positives, 'false alarm')}"
            tiles.append(Tile(_drawn(image), image.picture.path.name, caption))
    return tiles


def _drawn(image: images.MeasuredImage) -> Image:
    picture = image.picture.read()
    outlines = [(image.regions, IGNORED, 1)]
    for frame in image.shown.frames:
        outlines += [(frame.vehicle_boxes, TRUE, 2), (frame.track_boxes, FOUND, 1)]
    height, width = picture.shape[:2]
    return draw_tile(picture, Box(0, 0, width, height), _TILE_WIDTH, *outlines)
