"""Charts of videos: timelines, precision and recall of a sweep, AP by IoU. Need matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from vdet.evaluate.clips.evaluate import ClipResult, RunResult, best
from vdet.evaluate.comparison import pool
from vdet.evaluate.detection_metrics import IOU_THRESHOLDS, average_precisions
from vdet.evaluate.report.page import BAD, COLORS, GOOD, INK, SOFT, draw
from vdet.evaluate.timelines import Timeline

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOST_LINES = 12  # more would not be told apart in a legend
_WIDTH = 11.2


def timeline_chart(clip: ClipResult) -> str:
    """Return as SVG when each vehicle was found, missed or switched, and the false alarms."""
    height = 1.4 + 0.42 * (len(clip.timelines) + 1)
    return draw(lambda axes: _timelines(axes, clip), _WIDTH, height)


def sweep_chart(runs: Sequence[RunResult]) -> str:
    """Return as SVG the precision and recall of every setting."""
    return draw(lambda axes: _sweep(axes, runs), 7, 5.4)


def tightness_chart(run: RunResult) -> str:
    """Return as SVG the average precision at each IoU threshold."""
    return draw(lambda axes: _tightness(axes, run), 4.4, 3.6)


def _timelines(axes: Axes, clip: ClipResult) -> None:
    for row, timeline in enumerate(clip.timelines):
        _bars(axes, row, timeline)
        axes.plot(
            timeline.switches, [row - 0.36] * len(timeline.switches), "v", color=INK, markersize=7
        )
    alarms = [(loss.first - 0.5, loss.boxes) for loss in clip.losses if loss.kind == "false alarm"]
    bottom = len(clip.timelines)
    axes.broken_barh(alarms, (bottom - 0.12, 0.24), color=BAD, alpha=0.45, linewidth=0)
    names = [f"vehicle {timeline.vehicle}" for timeline in clip.timelines]
    axes.set_yticks(range(bottom + 1), [*names, "false alarms"])
    axes.set(title="Seen (green, with the track's id), missed (red), switched (▼)", xlabel="frame")
    axes.set_ylim(bottom + 0.5, -0.7)
    axes.margins(x=0.01)
    axes.set_xlim(left=0.5)
    axes.grid(visible=False, axis="y")


def _bars(axes: Axes, row: int, timeline: Timeline) -> None:
    for stretch in timeline.stretches:
        start, length = stretch.first - 0.5, stretch.last - stretch.first + 1
        color = BAD if stretch.track is None else GOOD
        axes.broken_barh([(start, length)], (row - 0.24, 0.48), color=color, linewidth=0)
        if stretch.track is not None:
            middle = start + length / 2
            label = axes.text(middle, row, f"#{stretch.track}", color="white", ha="center")
            label.set(va="center_baseline", fontsize=8, clip_on=True)
            label.set_visible(length >= _shortest_named(timeline))


def _shortest_named(timeline: Timeline) -> float:
    """Return the fewest frames of a stretch into which its name fits."""
    frames = timeline.stretches[-1].last - timeline.stretches[0].first + 1
    return frames / 40


def _sweep(axes: Axes, runs: Sequence[RunResult]) -> None:
    """Draw a line along the values of the first key for each combination of the others."""
    from matplotlib import colormaps

    lines: dict[tuple[str, ...], list[RunResult]] = {}
    for run in runs:
        lines.setdefault(run.assignments[1:], []).append(run)
    top = best(runs)
    colors = colormaps["viridis"](np.linspace(0, 0.85, len(lines)))
    for (others, along), color in zip(lines.items(), colors, strict=True):
        axes.plot(*_points(along), "o-", color=color, markersize=5, label=" ".join(others) or None)
        if top in along:
            _name_points(axes, along)
    axes.plot(*_points([top]), "o", color=BAD, markersize=10, zorder=3)
    key = top.assignments[0].partition("=")[0]
    axes.set(title=f"Along {key} (best F1 in red)", xlabel="recall", ylabel="precision")
    _f1_lines(axes)
    if 1 < len(lines) <= _MOST_LINES:
        axes.legend(fontsize=8)


def _points(runs: Sequence[RunResult]) -> tuple[list[float], list[float]]:
    return [run.total.recall for run in runs], [run.total.precision for run in runs]


def _name_points(axes: Axes, runs: Sequence[RunResult]) -> None:
    for run, x, y in zip(runs, *_points(runs), strict=True):
        value = run.assignments[0].partition("=")[2]
        axes.annotate(value, (x, y), xytext=(7, 6), textcoords="offset points", size=9)


def _f1_lines(axes: Axes) -> None:
    """Draw the curves of equal F1 = 2pr / (p + r) in the visible range and a little around it."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    left, right = max(0.0, left - 0.05), min(1.0, right + 0.05)
    bottom, top = max(0.0, bottom - 0.05), min(1.01, top + 0.05)
    step = 0.1 if top - bottom > 0.5 else 0.05
    for f1 in np.arange(step, 1, step).tolist():
        recall = np.linspace(f1 / (2 - f1), 1, 200)
        precision = f1 * recall / (2 * recall - f1)
        axes.plot(recall, precision, color=SOFT, linewidth=0.7, linestyle=":")
        end = f1 * right / (2 * right - f1) if 2 * right > f1 else np.inf
        if bottom < end < top:
            axes.annotate(f"F1 {f1:.2f}", (right, end), color=SOFT, size=7, ha="right", va="bottom")
    axes.set(xlim=(left, right), ylim=(bottom, top))


def _tightness(axes: Axes, run: RunResult) -> None:
    values = average_precisions(pool([clip.comparison for clip in run.clips]))
    axes.plot(IOU_THRESHOLDS, values, "o-", color=COLORS[0], markersize=4)
    axes.set(title="How tight the boxes are", xlabel="IoU asked for", ylabel="average precision")
    axes.set_ylim(-0.01, 1.02)
