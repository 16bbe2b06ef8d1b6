"""The report on the classifier. Needs matplotlib."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import cv2
import numpy as np

from vdet.evaluate.output import RunName, run_lines, share
from vdet.evaluate.report.page import COLORS, INK, SOFT, charts, draw, unit_axis
from vdet.learn.svm.dataset import read_patches
from vdet.learn.svm.patch_eval.evaluate import Mistake, PatchReport, TrialReport
from vdet.learn.svm.patch_eval.text import group_rows, metric_rows
from vdet.pages.frame import Picture, cards, contact_sheet, html_table, page, paragraph, section

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_TILE = 128  # side of a picture, pixels
_CHART_SIDE = 3.55  # inches


def patch_page(report: PatchReport, run: RunName) -> str:
    """Return the report as HTML."""
    patches = f"{report.vehicles} patches of vehicles, {report.non_vehicles} of other things"
    subtitle = "; ".join([patches, *run_lines(run)])
    return page("vdet: the classifier", subtitle, _sections(report))


def _sections(report: PatchReport) -> Iterator[str]:
    figures = [(f"accuracy, {each.name}", share(each.scores.accuracy)) for each in report.trials]
    meanings = [paragraph(trial.meaning) for trial in report.trials]
    headings = ["", *(trial.name for trial in report.trials)]
    rows = metric_rows(report)
    note = "In brackets: the 95 % interval of a bootstrap over the test patches."
    yield section(
        "In short", cards(figures), *meanings, html_table(headings, rows), paragraph(note)
    )
    yield section("Curves", charts(_curves(report)))
    yield section(
        "Right and wrong",
        charts(
            (f"confusion matrix, {each.name}", _confusion_chart(each)) for each in report.trials
        ),
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
        paragraph("Vehicles taken for something else, the worst mistake first:"),
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


def _curves(report: PatchReport) -> list[tuple[str, str]]:
    """Return the curves of all tests, `(what it shows, SVG)` each."""
    drawn = [
        ("ROC curve", lambda axes: _roc(axes, report)),
        ("Precision and recall", lambda axes: _precision_recall(axes, report)),
        ("Reliability", lambda axes: _reliability(axes, report)),
    ]
    return [(name, draw(plot, _CHART_SIDE, _CHART_SIDE)) for name, plot in drawn]


def _confusion_chart(trial: TrialReport) -> str:
    """Return the confusion matrix of a test as SVG."""
    return draw(lambda axes: _confusion(axes, trial), 3.6, 3)


def _roc(axes: Axes, report: PatchReport) -> None:
    for trial, color in zip(report.trials, COLORS, strict=False):
        if trial.curves:
            label = f"{trial.name} ({share(trial.scores.roc_auc, 4)})"
            curves = trial.curves
            axes.plot(
                curves.false_positive_rates, curves.true_positive_rates, color=color, label=label
            )
    unit_axis(axes, "ROC curve (area)", "false alarms / non-vehicles", "found / vehicles")
    axes.set_xlim(0, 1.05)
    axes.set_xscale("symlog", linthresh=0.01)
    axes.set_xticks([0, 0.01, 0.1, 1], ["0", "0.01", "0.1", "1"])
    axes.legend(loc="lower right")


def _precision_recall(axes: Axes, report: PatchReport) -> None:
    for trial, color in zip(report.trials, COLORS, strict=False):
        if trial.curves:
            label = f"{trial.name} ({share(trial.scores.average_precision, 4)})"
            axes.plot(trial.curves.recalls, trial.curves.precisions, color=color, label=label)
    unit_axis(axes, "Precision–recall (average)", "recall", "precision")
    axes.legend(loc="lower left")


def _reliability(axes: Axes, report: PatchReport) -> None:
    axes.plot([0, 1], [0, 1], color=SOFT, linestyle="--", linewidth=1)
    for trial, color in zip(report.trials, COLORS, strict=False):
        probabilities = [each.mean_probability for each in trial.reliability]
        shares = [each.vehicle_share for each in trial.reliability]
        label = f"{trial.name} ({share(trial.scores.calibration_error)})"
        axes.plot(probabilities, shares, color=color, linewidth=1, label=label)
        sizes = [
            4 + 40 * (each.patches / trial.scores.patches) ** 0.5 for each in trial.reliability
        ]
        axes.scatter(probabilities, shares, sizes, color=color, alpha=0.8)
    unit_axis(axes, "Reliability (calibration error)", "probability given", "share of vehicles")
    axes.legend(loc="lower right")


def _confusion(axes: Axes, trial: TrialReport) -> None:
    counts = trial.scores.confusion
    cells = [
        [counts.true_positives, counts.false_negatives],
        [counts.false_positives, counts.true_negatives],
    ]
    shares = [[cell / max(1, sum(row)) for cell in row] for row in cells]
    axes.imshow(shares, cmap="GnBu", vmin=0, vmax=1, aspect="auto")
    for row in (0, 1):
        for column in (0, 1):
            color = "white" if shares[row][column] > 0.6 else INK
            text = f"{cells[row][column]}\n{shares[row][column]:.1%}"
            axes.text(column, row, text, ha="center", va="center", color=color, fontsize=11)
    names = ["vehicle", "other"]
    axes.set_xticks([0, 1], names)
    axes.set_yticks([0, 1], names)
    axes.set(title=trial.name, xlabel="said to be", ylabel="is")
    axes.grid(visible=False)
