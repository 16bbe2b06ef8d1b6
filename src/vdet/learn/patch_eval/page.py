"""The report on the classifier."""

from collections.abc import Iterator, Sequence

import cv2
import numpy as np

from vdet.evaluate.output import share
from vdet.evaluate.report.page import (
    Picture,
    cards,
    charts,
    contact_sheet,
    html_table,
    page,
    paragraph,
    section,
)
from vdet.learn.dataset import read_patches
from vdet.learn.patch_eval.charts import confusion_chart, patch_charts
from vdet.learn.patch_eval.results import Mistake, PatchReport, TrialReport
from vdet.learn.patch_eval.text import group_rows, measure_rows

_TILE = 128


def patch_page(report: PatchReport) -> str:
    """Return the report as HTML. Needs matplotlib."""
    subtitle = f"{report.vehicles} patches of vehicles, {report.non_vehicles} of other things"
    return page("vdet: the classifier", subtitle, _sections(report))


def _sections(report: PatchReport) -> Iterator[str]:
    figures = [(f"accuracy, {each.name}", share(each.scores.accuracy)) for each in report.trials]
    meanings = [paragraph(trial.meaning) for trial in report.trials]
    headings = ["", *(trial.name for trial in report.trials)]
    rows = measure_rows(report)
    note = "In brackets: the 95 % interval of a bootstrap over the test patches."
    yield section(
        "In short", cards(figures), *meanings, html_table(headings, rows), paragraph(note)
    )
    yield section("Curves", charts(patch_charts(report)))
    yield section(
        "Right and wrong",
        charts((f"confusion matrix, {each.name}", confusion_chart(each)) for each in report.trials),
    )
    yield section("Accuracy by group", html_table(headings, group_rows(report)))
    for trial in report.trials:
        yield _worst(trial)


def _worst(trial: TrialReport) -> str:
    title = f"Worst mistakes: {trial.name}"
    if not trial.mistakes:
        return section(title, paragraph("None."))
    missed = [mistake for mistake in trial.mistakes if mistake.file.vehicle]
    alarms = [mistake for mistake in trial.mistakes if not mistake.file.vehicle]
    return section(
        title,
        paragraph("Vehicles taken for something else, the surest mistake first:"),
        contact_sheet(_pictures(missed), _TILE),
        paragraph("Other things taken for vehicles:"),
        contact_sheet(_pictures(alarms), _TILE),
    )


def _pictures(mistakes: Sequence[Mistake]) -> Iterator[Picture]:
    patches = read_patches([mistake.file for mistake in mistakes])
    for mistake, patch in zip(mistakes, patches, strict=True):
        if patch.image is not None:
            tile = cv2.resize(patch.image, (_TILE, _TILE), interpolation=cv2.INTER_CUBIC)
            name = mistake.file.name.rpartition("/")[2]
            caption = f"{mistake.file.group}/{name}"
            yield Picture(np.asarray(tile, np.uint8), f"p = {mistake.probability:.3f}", caption)
