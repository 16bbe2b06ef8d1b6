"""The parts of a report: sections of one HTML file without links, charts as SVG in one style.

Charts need matplotlib.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

import cv2

import vdet
from vdet.evaluate.output import load_matplotlib
from vdet.media.images import Image

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

_PAGE_STYLE = """
:root { --ink: #1d2733; --soft: #64748b; --line: #e2e8f0; --mark: #0f766e; }
* { box-sizing: border-box; }
body { margin: 0; background: #f4f6f8; color: var(--ink);
  font: 15px/1.5 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; }
header { background: #16212e; color: #fff; padding: 30px 40px 26px; }
header h1 { margin: 0; font-size: 26px; letter-spacing: -.01em; }
header p { margin: 6px 0 0; color: #a9b8c9; overflow-wrap: anywhere; }
main { max-width: 1180px; margin: 0 auto; padding: 24px; }
section { background: #fff; border: 1px solid var(--line); border-radius: 10px;
  padding: 20px 26px 24px; margin-bottom: 20px; }
h2 { margin: 0 0 10px; font-size: 18px; overflow-wrap: anywhere; }
p { margin: 8px 0; color: var(--soft); max-width: 90ch; }
.cards { display: grid; grid-template-columns: repeat(auto-fit, minmax(120px, 1fr)); gap: 14px; }
.card { border-left: 4px solid var(--mark); padding: 2px 0 2px 12px; }
.card b { display: block; font-size: 26px; line-height: 1.2; font-variant-numeric: tabular-nums; }
.card span { color: var(--soft); font-size: 13px; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; margin: 10px 0; }
th, td { padding: 5px 16px 5px 0; text-align: right; border-bottom: 1px solid var(--line);
  white-space: nowrap; }
th { color: var(--soft); font-weight: 600; font-size: 13px; }
th:first-child, td:first-child { text-align: left; white-space: normal; }
tr.best td { background: #e6f4f1; font-weight: 600; }
.charts { display: flex; flex-wrap: wrap; gap: 20px; align-items: flex-start; }
.charts img { max-width: 100%; height: auto; }
.sheet { display: grid; grid-template-columns: repeat(auto-fill, minmax(var(--tile), 1fr));
  gap: 14px; }
.sheet figure { margin: 0; }
.sheet img { width: 100%; border-radius: 6px; display: block; background: #111; }
.sheet figcaption { font-size: 12.5px; color: var(--soft); margin-top: 5px; line-height: 1.35;
  overflow-wrap: anywhere; }
.sheet figcaption b { color: var(--ink); display: block; }
footer { color: var(--soft); font-size: 12.5px; text-align: center; padding: 0 0 30px; }
"""


@dataclass(frozen=True, slots=True)
class Picture:
    """A BGR uint8 image for a contact sheet, with the title and the caption below it."""

    image: Image
    title: str
    caption: str


def page(title: str, subtitle: str, sections: Iterable[str]) -> str:
    """Return a whole page; `sections` come from `section`."""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_PAGE_STYLE}</style>\n</head>\n<body>\n"
        f"<header><h1>{escape(title)}</h1><p>{escape(subtitle)}</p></header>\n<main>\n"
        + "\n".join(sections)
        + f"\n</main>\n<footer>vdet {escape(vdet.__version__)}</footer>\n</body>\n</html>\n"
    )


def section(title: str, *parts: str) -> str:
    """Return a section with a title; the parts are HTML."""
    return f"<section><h2>{escape(title)}</h2>\n" + "\n".join(parts) + "\n</section>"


def paragraph(text: str) -> str:
    """Return text as a paragraph."""
    return f"<p>{escape(text)}</p>"


def cards(figures: Iterable[tuple[str, str]]) -> str:
    """Return key figures, `(name, value)` each, in large type."""
    items = "".join(
        f'<div class="card"><b>{escape(value)}</b><span>{escape(name)}</span></div>'
        for name, value in figures
    )
    return f'<div class="cards">{items}</div>'


def html_table(
    headings: Sequence[str], rows: Iterable[Sequence[str]], best: int | None = None
) -> str:
    """Return a table; the row with index `best` is highlighted."""
    head = "".join(f"<th>{escape(text)}</th>" for text in headings)
    body = "".join(
        ('<tr class="best">' if number == best else "<tr>")
        + "".join(f"<td>{escape(text)}</td>" for text in row)
        + "</tr>"
        for number, row in enumerate(rows)
    )
    return f'<div class="wide"><table><tr>{head}</tr>{body}</table></div>'


def charts(svgs: Iterable[tuple[str, str]]) -> str:
    """Return charts, `(what it shows, SVG)` each, side by side if the page is wide enough."""
    images = "".join(
        f'<img alt="{escape(alt)}" src="{_uri("image/svg+xml", svg.encode())}">'
        for alt, svg in svgs
    )
    return f'<div class="charts">{images}</div>'


def contact_sheet(pictures: Iterable[Picture], tile: int) -> str:
    """Return pictures in a grid of tiles, each about `tile` pixels wide."""
    figures = "".join(
        f'<figure><img alt="{escape(picture.title)}" src="{_jpeg_uri(picture.image)}">'
        f"<figcaption><b>{escape(picture.title)}</b>{escape(picture.caption)}</figcaption></figure>"
        for picture in pictures
    )
    return f'<div class="sheet" style="--tile: {tile}px">{figures}</div>'


def _jpeg_uri(image: Image) -> str:
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 88])
    return _uri("image/jpeg", data.tobytes())


def _uri(kind: str, data: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode('ascii')}"


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
