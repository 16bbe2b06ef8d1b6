"""The frame of a page and its plain parts: one HTML file that loads nothing, light and dark."""

import base64
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

import cv2

from vdet.media.images import Image
from vdet.version import __version__

PAGE_NAME = "page.html"
"""Name of the file of a page in its folder."""

_STYLE = """
:root { color-scheme: light dark;
  --ink: #1d2733; --soft: #5b6b80; --line: #e2e8f0; --mark: #0f766e; --best: #e6f4f1;
  --ground: #f4f6f8; --paper: #fff; --head: #16212e; --fill: #0f9d8a; }
@media (prefers-color-scheme: dark) { :root {
  --ink: #e3e9f1; --soft: #9fb0c3; --line: #2e3b4a; --mark: #2bb3a3; --best: #12332f;
  --ground: #10161d; --paper: #18212b; --head: #0b1016; --fill: #1f9e8e; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--ground); color: var(--ink);
  font: 15px/1.5 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; }
a { color: var(--mark); }
header { background: var(--head); color: #fff; padding: 30px 40px 26px; }
header h1 { margin: 0; font-size: 26px; letter-spacing: -.01em; overflow-wrap: anywhere; }
header p { margin: 6px 0 0; color: #a9b8c9; overflow-wrap: anywhere; }
main { max-width: 1180px; margin: 0 auto; padding: 24px; }
section { background: var(--paper); border: 1px solid var(--line); border-radius: 10px;
  padding: 20px 26px 24px; margin-bottom: 20px; }
h2 { margin: 0 0 10px; font-size: 18px; overflow-wrap: anywhere; }
p { margin: 8px 0; color: var(--soft); max-width: 90ch; overflow-wrap: anywhere; }
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
tr.best td { background: var(--best); font-weight: 600; }
.charts { display: flex; flex-wrap: wrap; gap: 20px; align-items: flex-start; }
.charts img { max-width: 100%; height: auto; background: #fff; border-radius: 6px; }
.sheet { display: grid; gap: 14px;
  grid-template-columns: repeat(auto-fill, minmax(min(var(--tile), 100%), 1fr)); }
.sheet figure { margin: 0; }
.sheet img { width: 100%; border-radius: 6px; display: block; background: #111; }
.sheet figcaption { font-size: 12.5px; color: var(--soft); margin-top: 5px; line-height: 1.35;
  overflow-wrap: anywhere; }
.sheet figcaption b { color: var(--ink); display: block; }
footer { color: var(--soft); font-size: 12.5px; text-align: center; padding: 0 0 30px; }
@media (max-width: 600px) { header { padding: 20px 16px 16px; } main { padding: 10px; }
  section { padding: 14px 14px 16px; } }
"""


@dataclass(frozen=True, slots=True)
class Picture:
    """A BGR uint8 image for a contact sheet, with the title and the caption below it."""

    image: Image
    title: str
    caption: str


def page(
    title: str, subtitle: str, sections: Iterable[str], *, style: str = "", end: str = ""
) -> str:
    """Return a whole page; `sections` come from `section`.

    `style` is CSS of this kind of page, `end` is HTML behind all else.
    """
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}{style}</style>\n</head>\n<body>\n"
        f"<header><h1>{escape(title)}</h1><p>{escape(subtitle)}</p></header>\n<main>\n"
        + "\n".join(sections)
        + f"\n</main>\n<footer>vdet {escape(__version__)}</footer>\n{end}</body>\n</html>\n"
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


def contact_sheet(pictures: Iterable[Picture], tile: int) -> str:
    """Return pictures in a grid of tiles, each about `tile` pixels wide."""
    figures = "".join(
        f'<figure><img alt="{escape(picture.title)}" src="{jpeg_uri(picture.image)}">'
        f"<figcaption><b>{escape(picture.title)}</b>{escape(picture.caption)}</figcaption></figure>"
        for picture in pictures
    )
    return f'<div class="sheet" style="--tile: {tile}px">{figures}</div>'


def jpeg_uri(image: Image, quality: int = 88) -> str:
    """Return a BGR uint8 image as a data URI."""
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return data_uri("image/jpeg", data.tobytes())


def data_uri(kind: str, data: bytes) -> str:
    """Return data of a media type such as `image/jpeg` as a data URI."""
    return f"data:{kind};base64,{base64.b64encode(data).decode('ascii')}"
