"""What evaluations show: tables, ratios, the detector that was measured, and pictures."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from vdet.boxes import Box, Float64Array
from vdet.config.schema import DetectorSettings
from vdet.detect.factory import model_file, trained_on
from vdet.draw.paint import Color
from vdet.media.images import Image
from vdet.version import __version__

ABSENT = "–"

TRUE: Color = (90, 220, 60)
FOUND: Color = (40, 120, 255)
IGNORED: Color = (160, 160, 160)


@dataclass(frozen=True, slots=True)
class RunName:
    """Which detector was measured.

    Its kind, model file, file of settings and changes to them, and the names of the data that the
    model was trained on, as far as its file says.
    """

    detector: str
    model: Path | None
    config: str | None
    assignments: tuple[str, ...]
    trained_on: tuple[str, ...] = ()

    @staticmethod
    def of(
        detector: DetectorSettings,
        model: Path | None,
        config: str | None,
        assignments: tuple[str, ...],
    ) -> "RunName":
        """Return which detector is measured; `model` is its file, None for the shipped one."""
        file = model_file(detector, model)
        return RunName(detector.kind, file, config, assignments, trained_on(detector, file))

    def lines(self) -> list[str]:
        """Return which detector was measured, and what its model was trained on."""
        model = f", model {self.model.name}" if self.model else ""
        settings = " ".join([self.config or "default", *self.assignments])
        lines = [f"vdet {__version__}, detector {self.detector}{model}, settings {settings}"]
        return [*lines, f"trained on {', '.join(self.trained_on)}"] if self.trained_on else lines

    def values(self) -> dict[str, Any]:
        """Return which detector was measured as values for JSON."""
        return {
            "program": f"vdet {__version__}",
            "detector": self.detector,
            "model": str(self.model) if self.model else None,
            "config": self.config or "default",
            "set": list(self.assignments),
            "trained_on": list(self.trained_on),
        }


def table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return aligned lines, headings first: the first column to the left, the others to the right.

    Parameters
    ----------
    headings
        One per column.
    rows
        One text per column each.
    """
    widths = [max(map(len, column)) for column in zip(headings, *rows, strict=True)]
    return [_line(row, widths) for row in (headings, *rows)]


def _line(row: Sequence[str], widths: Sequence[int]) -> str:
    first, *others = zip(row, widths, strict=True)
    cells = [first[0].ljust(first[1]), *(text.rjust(width) for text, width in others)]
    return "  ".join(cells).rstrip()


def share(value: float | None, digits: int = 3) -> str:
    """Write a ratio; a dash for None."""
    return ABSENT if value is None else f"{value:.{digits}f}"


@dataclass(frozen=True, slots=True)
class Tile:
    """A BGR uint8 image with the title and the caption below it."""

    image: Image
    title: str
    caption: str


Outlines = tuple[Float64Array, Color, int]
"""Boxes to draw, float64 `(n, 4)`: x1, y1, x2, y2; the colour and width of the outlines."""


def draw_tile(image: Image, part: Box, width: int, *outlines: Outlines) -> Image:
    """Cut a part out of a BGR uint8 frame, scale it to a width, and draw boxes."""
    cut = part.cut(image)
    scale = width / cut.shape[1]
    target = width, max(1, round(cut.shape[0] * scale))
    kind = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    tile = np.asarray(cv2.resize(cut, target, interpolation=kind), np.uint8)
    for boxes, color, line in outlines:
        corners = ((boxes - (part.x1, part.y1, part.x1, part.y1)) * scale).round().astype(int)
        for x1, y1, x2, y2 in corners.tolist():
            cv2.rectangle(tile, (x1, y1), (x2, y2), color, line)
    return tile
