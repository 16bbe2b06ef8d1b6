"""A report on patches as lines of text, and as values for JSON."""

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from vdet.evaluate.output import ABSENT, share, table
from vdet.learn.svm.patch_eval.evaluate import PatchReport
from vdet.learn.svm.patch_eval.metrics import METRICS, PatchScores

NAMES = {
    "accuracy": "accuracy",
    "precision": "precision",
    "recall": "recall",
    "f1": "F1",
    "roc_auc": "ROC AUC",
    "average_precision": "average precision",
    "log_loss": "log loss",
    "calibration_error": "calibration error",
}
"""The metrics by their usual names."""


def lines(report: PatchReport) -> Iterator[str]:
    """Yield the report as lines: all tests side by side, their groups, the confusion of each."""
    broken = f" ({report.broken} broken ones skipped)" if report.broken else ""
    yield f"patches: {report.vehicles} vehicles, {report.non_vehicles} non-vehicles{broken}"
    yield ""
    headings = ["95 % intervals in brackets", *(trial.name for trial in report.trials)]
    yield from table(headings, metric_rows(report))
    yield ""
    headings = ["accuracy by group", *(trial.name for trial in report.trials)]
    yield from table(headings, group_rows(report))
    for trial in report.trials:
        yield ""
        yield trial.meaning
        yield from confusion_table(trial.scores)


def metric_rows(report: PatchReport) -> list[list[str]]:
    """Return a row of text for each metric: its name, then its value in each test."""
    counts = ["patches tested", *(str(trial.scores.patches) for trial in report.trials)]
    rows = [
        [NAMES[name], *(_with_interval(trial.scores, name) for trial in report.trials)]
        for name in METRICS
    ]
    return [counts, *rows]


def confusion_table(scores: PatchScores) -> list[str]:
    """Return the confusion matrix as lines."""
    confusion = scores.confusion
    rows = [
        ["is vehicle", str(confusion.true_positives), str(confusion.false_negatives)],
        ["is non-vehicle", str(confusion.false_positives), str(confusion.true_negatives)],
    ]
    return table(("", "said vehicle", "said non-vehicle"), rows)


def group_rows(report: PatchReport) -> list[list[str]]:
    """Return a row of text for each group: its name, then its accuracy in each test."""
    accuracies = [
        {each.group: _with_interval(each.scores, "accuracy") for each in trial.groups}
        for trial in report.trials
    ]
    groups = sorted({group for of_trial in accuracies for group in of_trial})
    return [[group, *(each.get(group, ABSENT) for each in accuracies)] for group in groups]


def plain(report: PatchReport) -> dict[str, Any]:
    """Return the report as values for JSON, without the points of the curves."""
    values = asdict(report)
    for trial, source in zip(values["trials"], report.trials, strict=True):
        del trial["curves"]
        trial["mistakes"] = [
            {"file": str(mistake.file), "probability": mistake.probability}
            for mistake in source.mistakes
        ]
    return values


def _with_interval(scores: PatchScores, name: str) -> str:
    value, interval = getattr(scores, name), scores.intervals.get(name)
    if value is None or interval is None:
        return ABSENT
    return f"{share(value, 4)} [{share(interval.low)}, {share(interval.high)}]"
