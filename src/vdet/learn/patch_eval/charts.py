"""Charts of the classifier: ROC, precision and recall, reliability, confusion. Need matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING

from vdet.evaluate.output import share
from vdet.evaluate.report.page import COLORS, INK, SOFT, draw, unit_axis
from vdet.learn.patch_eval.results import PatchReport, TrialReport

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SIDE = 3.55


def patch_charts(report: PatchReport) -> list[tuple[str, str]]:
    """Return the curves of all tests, `(what it shows, SVG)` each."""
    drawn = [
        ("ROC curve", lambda axes: _roc(axes, report)),
        ("Precision and recall", lambda axes: _precision_recall(axes, report)),
        ("Reliability", lambda axes: _reliability(axes, report)),
    ]
    return [(name, draw(plot, _SIDE, _SIDE)) for name, plot in drawn]


def confusion_chart(trial: TrialReport) -> str:
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
