"""Charts of a report as SVG in one style. They need matplotlib."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable
from html import escape
from typing import TYPE_CHECKING, Any

from vdet.evaluate.output import load_matplotlib
from vdet.pages.frame import data_uri

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK = "#1d2733"
SOFT = "#94a3b8"
GOOD = "#0f9d8a"
BAD = "#e4572e"
COLORS = ("#0f766e", "#d97706", "#4f46e5", "#be185d")

_CHART_STYLE: Any = {
    "font.family": "sans-serif",
    "font.size": 10,
    "axes.titlesize": 11,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.edgecolor": SOFT,
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e2e8f0",
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.frameon": False,
    "svg.hashsalt": "vdet",  # makes the file reproducible
}


def charts(svgs: Iterable[tuple[str, str]]) -> str:
    """Return charts, `(what it shows, SVG)` each, side by side if the page is wide enough."""
    images = "".join(
        f'<img alt="{escape(alt)}" src="{data_uri("image/svg+xml", svg.encode())}">'
        for alt, svg in svgs
    )
    return f'<div class="charts">{images}</div>'


def draw(plot: Callable[[Axes], object], width: float, height: float) -> str:
    """Return what `plot` draws on its axes as SVG; width and height are in inches."""
    load_matplotlib()
    from matplotlib import rc_context, rcdefaults, rcParams
    from matplotlib.figure import Figure

    with rc_context():
        rcdefaults()  # a chart does not depend on the user's settings
        rcParams.update(_CHART_STYLE)
        figure = Figure(figsize=(width, height), layout="constrained")
        plot(figure.add_subplot())
        return _svg(figure)


def _svg(figure: Figure) -> str:
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue()


def unit_axis(axes: Axes, title: str, x: str, y: str) -> None:
    """Label the axes and let both run from 0 to 1."""
    axes.set(title=title, xlabel=x, ylabel=y, xlim=(-0.01, 1.01), ylim=(-0.01, 1.02))
