"""The report on detection in labelled pictures."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from vdet.boxes import Float64Array
from vdet.draw.paint import Color
from vdet.evaluate.images.evaluate import ImagesResult
from vdet.evaluate.images.scores import SIZE_NAMES, MeasuredImage, Source
from vdet.evaluate.images.text import (
    HEADINGS,
    SIZE_HEADINGS,
    counting_line,
    others_lines,
    rows,
    size_rows,
)
from vdet.evaluate.matching import match
from vdet.evaluate.output import RunName, run_lines, share
from vdet.evaluate.report.page import COLORS, SOFT, charts, draw, unit_axis
from vdet.evaluate.report.video_page import FOUND_COLOR, TRUE_COLOR
from vdet.labels.pictures.labelled import LabelledImages
from vdet.media.images import Image
from vdet.pages.frame import Picture, cards, contact_sheet, html_table, page, paragraph, section

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_IGNORED_COLOR: Color = (160, 160, 160)
_TILE = 480  # width of a picture, pixels
_MOST_PICTURES = 9  # of each source


def images_page(result: ImagesResult, run: RunName) -> str:
    """Return the report as HTML.

    Needs matplotlib. Raises `ImageError` if a picture can no longer be read.
    """
    subtitle = "; ".join([*run_lines(run), counting_line(result)])
    return page("vdet: vehicles in pictures", subtitle, _sections(result))


def _sections(result: ImagesResult) -> Iterator[str]:
    yield section(
        "In short",
        cards(_key_figures(result)),
        html_table(HEADINGS, rows(result)),
        *map(paragraph, others_lines(result)),
    )
    yield section(
        "By score and by size",
        charts(
            [
                ("F1 by score", draw(lambda axes: _plot_f1(axes, result), 6, 4.2)),
                ("recall by width", draw(lambda axes: _plot_sizes(axes, result), 6, 4.2)),
            ]
        ),
        html_table(SIZE_HEADINGS, size_rows(result)),
    )
    for labelled, source in zip(result.sets, result.sources, strict=True):
        if pictures := worst_pictures(source, result.counting.score):
            legend = "True boxes in green, found ones in orange, ignore regions in grey."
            sheet = contact_sheet(pictures, _TILE * 2 // 3)
            yield section(f"Most mistakes: {labelled.name}", paragraph(legend), sheet)


def _key_figures(result: ImagesResult) -> list[tuple[str, str]]:
    mean = result.mean
    return [
        ("precision", share(mean.precision)),
        ("recall", share(mean.recall)),
        ("F1 at IoU 0.5", share(mean.f1)),
        ("AP50", share(mean.ap50)),
        ("AP50:95", share(mean.ap50_95)),
        ("mean IoU", share(mean.mean_iou)),
        ("best F1", share(mean.best_f1)),
    ]


def _plot_f1(axes: Axes, result: ImagesResult) -> None:
    for number, (labelled, source) in enumerate(zip(result.sets, result.sources, strict=True)):
        if source.scores.vehicles:
            style = _style(number, labelled)
            axes.plot(source.curve.scores, source.curve.f1, **style)
    axes.axvline(result.counting.score, color=SOFT, linestyle="--")
    unit_axis(axes, "F1 by the least score that counts (dashed: here)", "score", "F1")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8)


def _plot_sizes(axes: Axes, result: ImagesResult) -> None:
    width = 0.8 / len(result.sources)
    for number, (labelled, source) in enumerate(zip(result.sets, result.sources, strict=True)):
        places = np.arange(len(SIZE_NAMES)) + (number + 0.5) * width - 0.4
        recalls = [size.recall or 0 for size in source.scores.sizes]
        axes.bar(places, recalls, width, **_style(number, labelled))
    axes.set_xticks(range(len(SIZE_NAMES)), SIZE_NAMES)
    axes.set(title="Recall by the width of the vehicle", ylabel="recall", ylim=(0, 1.02))
    axes.legend(fontsize=8)


def _style(number: int, labelled: LabelledImages) -> dict[str, Any]:
    """Return the colour and the label of a source; a `$` would begin a formula."""
    return {"color": COLORS[number % len(COLORS)], "label": labelled.name.replace("$", r"\$")}


def worst_pictures(source: Source, score: float) -> list[Picture]:
    """Return the pictures with the most mistakes at a score, with all boxes.

    Raises `ImageError` if a picture can no longer be read.
    """
    mistakes = [_mistakes(image, score) for image in source.images]
    ranked = sorted(zip(mistakes, source.images, strict=True), key=lambda each: -sum(each[0]))
    return [
        Picture(
            _drawn(image, score),
            image.searched.image.path.name,
            f"{missed} missed, {wrong} false alarms",
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
    labelled = image.searched.image
    picture = labelled.read()
    scale = _TILE / picture.shape[1]
    size = _TILE, max(1, round(picture.shape[0] * scale))
    tile = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)
    _outline(tile, image.truth.boxes[image.truth.ignored] * scale, _IGNORED_COLOR, 1)
    for frame in image.compare(score).frames:
        _outline(tile, frame.vehicle_boxes * scale, TRUE_COLOR, 2)
        _outline(tile, frame.track_boxes * scale, FOUND_COLOR, 1)
    return tile


def _outline(tile: Image, boxes: Float64Array, color: Color, line: int) -> None:
    for x, y, width, height in boxes.round().astype(int).tolist():
        cv2.rectangle(tile, (x, y), (x + width, y + height), color, line)
