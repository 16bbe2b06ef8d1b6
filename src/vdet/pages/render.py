"""Render pages: one HTML file that loads nothing from the network, in light and dark mode."""

import base64
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

import cv2
from markupsafe import Markup, escape

from vdet.boxes import Image
from vdet.errors import escaped, quantity
from vdet.media.images import shrunk
from vdet.pages.charts import hex_color, time_text
from vdet.version import __version__

Table = tuple[Sequence[str], Sequence[Sequence[str]]]
"""Headings and rows of text."""
PAGE_NAME, REVIEW_NAME = "page.html", "review.html"
"""File name of a page in its folder."""
TEMPLATES = Path(__file__).parent / "templates"
_QUALITY = 84  # of JPEG pictures
_SMALL_SIDE, _SMALL_BYTES = 96, 2048


def render(template: str, **values: Any) -> str:
    """Render a file in `templates` with values, all of them escaped."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        undefined=StrictUndefined,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"quantity": quantity, "jpeg": jpeg_uri, "hex": hex_color}
    environment.filters |= {"clock": time_text, "line": lambda text: escaped(str(text))}
    environment.filters |= {"name": _breakable}
    return environment.get_template(template).render(values, version=__version__)


def _breakable(name: str) -> Markup:
    """Return a name that is broken at its separators rather than in its numbers."""
    return Markup(re.sub(r"(?<=[-_/.])", "<wbr>", escape(name)))


def jpeg_uri(image: Image, max_side: int | None = None) -> str:
    """Return a BGR uint8 image as a data URI; its longer side has at most `max_side` pixels."""
    if max_side:
        image = shrunk(image, max_side / max(image.shape[:2]))
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    return "data:image/jpeg;base64," + base64.b64encode(data.tobytes()).decode("ascii")


def thumbnail(image: Image) -> bytes:
    """Return a BGR uint8 image as WebP of at most 96 pixels and 2 KB."""
    small = shrunk(image, _SMALL_SIDE / max(image.shape[:2]))
    for quality in (70, 50, 30, 10):
        data = cv2.imencode(".webp", small, [cv2.IMWRITE_WEBP_QUALITY, quality])[1].tobytes()
        if len(data) <= _SMALL_BYTES:
            break
    return data


def webp_uri(data: bytes) -> str:
    """Return a WebP image as a data URI."""
    return "data:image/webp;base64," + base64.b64encode(data).decode("ascii")


def link_to(path: Path, folder: Path) -> str:
    """Return the relative address of a file for a page in `folder`."""
    return quote(os.fsencode(os.path.relpath(path, folder)))
