"""The page on detection in labelled pictures."""

from vdet.evaluate.images import text
from vdet.evaluate.images.evaluate import ImagesResult
from vdet.evaluate.images.scores import SIZE_NAMES, MeasuredImage, Source
from vdet.evaluate.matching import match
from vdet.evaluate.output import RunName, run_lines, share
from vdet.evaluate.tiles import FOUND, IGNORED, TRUE, Tile, draw_tile
from vdet.media.images import Image
from vdet.pages.charts import SOFT, Axis, Bar, Line, Plot, color, curve, number_axis
from vdet.pages.render import render

_WIDTH = 480  # of a picture, pixels
_MOST_PICTURES = 9  # of each source


def images_page(result: ImagesResult, run: RunName) -> str:
    """Return the page as HTML. Raises `ImageError` if a picture can no longer be read."""
    score = result.counting.score
    named = zip(result.sets, result.sources, strict=True)
    sheets = [(labelled.name, worst_tiles(source, score)) for labelled, source in named]
    return render(
        "eval_images.html",
        subtitle="; ".join([*run_lines(run), text.counting_line(result)]),
        figures=list(zip(text.HEADINGS, text.rows(result)[-1], strict=True))[1:],
        headings=text.HEADINGS,
        rows=text.rows(result),
        others=text.others_lines(result),
        plots=(_f1_plot(result), _size_plot(result)),
        size_headings=text.SIZE_HEADINGS,
        size_rows=text.size_rows(result),
        sheets=[(name, tiles) for name, tiles in sheets if tiles],
    )


def _f1_plot(result: ImagesResult) -> Plot:
    lines = [
        curve(source.curve.scores, source.curve.f1, color(number))
        for number, source in enumerate(result.sources)
        if source.scores.vehicles
    ]
    lines.append(Line([(result.counting.score, 0), (result.counting.score, 1)], SOFT, dashed=True))
    title = "F1 by the lowest score that counts (dashed: here)"
    x = number_axis(0, 1, "score")
    return Plot(title, x, number_axis(0, 1), (), lines, _legend(result))


def _size_plot(result: ImagesResult) -> Plot:
    width = 0.8 / len(result.sources)
    bars = []
    for number, source in enumerate(result.sources):
        for place, size in enumerate(source.scores.sizes):
            left = place + 0.1 + number * width
            title = f"{result.sets[number].name}: {share(size.recall)}"
            bars.append(Bar(left, left + width, 0, size.recall or 0, color(number), title))
    ticks = [(place + 0.5, name) for place, name in enumerate(SIZE_NAMES)]
    x = Axis(0, len(SIZE_NAMES), ticks, "width of the vehicle")
    title = "Recall by the width of the vehicle"
    return Plot(title, x, number_axis(0, 1), bars, (), _legend(result))


def _legend(result: ImagesResult) -> list[tuple[str, str]]:
    return [(labelled.name, color(number)) for number, labelled in enumerate(result.sets)]


def worst_tiles(source: Source, score: float) -> list[Tile]:
    """Return the pictures with the most mistakes at a score, with all boxes.

    Raises `ImageError` if a picture can no longer be read.
    """
    mistakes = [_mistakes(image, score) for image in source.images]
    ranked = sorted(zip(mistakes, source.images, strict=True), key=lambda each: -sum(each[0]))
    return [
        Tile(
            _drawn(image, score),
            image.picture.path.name,
            f"{missed} missed, {wrong} false alarm{'s' if wrong != 1 else ''}",
        )
        for (missed, wrong), image in ranked[:_MOST_PICTURES]
        if missed or wrong
    ]


def _mistakes(image: MeasuredImage, score: float) -> tuple[int, int]:
    """Return the number of missed vehicles and of false alarms."""
    comparison = image.compare(score)
    found = sum(map(len, match(comparison)))
    return (
        int(comparison.vehicle_lengths().sum()) - found,
        int(comparison.track_lengths().sum()) - found,
    )


def _drawn(image: MeasuredImage, score: float) -> Image:
    picture = image.picture.read()
    outlines = [(image.truth.boxes[image.truth.ignored], IGNORED, 1)]
    for frame in image.compare(score).frames:
        outlines += [(frame.vehicle_boxes, TRUE, 2), (frame.track_boxes, FOUND, 1)]
    height, width = picture.shape[:2]
    return draw_tile(picture, (0, 0), (width, height), _WIDTH, *outlines)
