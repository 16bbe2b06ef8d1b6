"""How well one sees in the parts of a video, and what the shipped network finds in such pictures.

`benchmarks/conditions.py` measures what it finds in pictures of many roads, and writes the weights
of two logistic regressions: of the recall, and of how likely there are drops on the lens.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import cv2
import numpy as np

from vdet.boxes import Float32Array, Float64Array, Image
from vdet.conditions.finding import Finding, Severity, joined, when
from vdet.config.schema import Code

_TOP = 0.35
"""Where the part of the plane begins that shows a road, as a fraction of its height."""
_DARK = 45.0
"""Mean of what is dark, grey levels."""
_HAZY = 0.07
"""Local contrast of what is hazy, as a fraction of the mean."""
_BLURRED = 0.3
"""Fine contrast of what is blurred, as a fraction of the coarse."""
_DOUBTED = 0.5, 1.2
"""Recall below which these limits are wider, by this factor: the scores say the same."""
_PLAIN = 1.0
"""Local contrast of a plane that shows nothing to be seen, grey levels."""
_SHORTEST = 3.0
"""Seconds of bad sight from which it is reported; an underpass is shorter."""
_GAP = 2.0
"""Seconds of good sight that end a span."""
_AROUND = 2
"""Number of planes before and after one whose reasons count with its own."""
_SURE = 0.4
"""Score of a vehicle that is shown."""
_NOTED = 0.6
"""Recall from which bad sight is only noted."""
LIKELY = 0.9
"""Probability of drops on the lens from which they are reported."""
_TILES = 16, 9
"""Parts of a plane in which it is more or less fine: columns, rows."""

_WORDS: dict[Code, str] = {
    "dark": "it is dark",
    "haze": "contrast is low, as in fog or spray",
    "blur": "the image is blurred",
    "drops": "drops, dirt or spray are on the lens",
}


@dataclass(frozen=True, slots=True)
class Sight:
    """How well one sees in a frame.

    Attributes
    ----------
    brightness, contrast, sharpness
        Of the part that shows a road: grey levels, and the fine contrast per coarse contrast.
    texture
        Logarithms of the finest and the next contrast, how even the finest is over the frame, and
        how much edges have one direction. Drops are soft, everywhere, and of all directions.
    weak, sure
        Fraction of all scores that weak detections have, and the mean score of the others.
    """

    brightness: float
    contrast: float
    sharpness: float
    texture: tuple[float, ...]
    weak: float
    sure: float

    @classmethod
    def of(cls, fine_plane: Image, plane: Image, scores: Float64Array) -> "Sight":
        """Measure the planes of a frame, uint8 `(2h, 2w)` and `(h, w)`.

        `scores` are those of all its detections.
        """
        lower = plane[int(_TOP * len(plane)) :].astype(np.float32)
        squares = cv2.blur(lower * lower, (15, 15)) - cv2.blur(lower, (15, 15)) ** 2
        contrast = float(np.sqrt(np.maximum(squares, 0)).mean())
        fine, coarse = (
            float(np.abs(lower - cv2.GaussianBlur(lower, (0, 0), sigma)).mean()) for sigma in (1, 4)
        )
        is_sure = scores >= _SURE
        weak = float(scores[~is_sure].sum() / max(scores.sum(), 0.1))
        sure = float(scores[is_sure].mean()) if is_sure.any() else _SURE
        sharpness, texture = fine / max(coarse, 0.3), _texture(fine_plane.astype(np.float32))
        return cls(float(lower.mean()), contrast, sharpness, texture, weak, sure)

    @property
    def looks(self) -> tuple[float, ...]:
        """What `weights.json` weighs of the picture alone."""
        seen = np.log(np.maximum((self.brightness + 5, self.contrast, self.sharpness), 0.05))
        return *seen.tolist(), *self.texture

    @property
    def code(self) -> Code | None:
        """Why one does not see well; None if one does."""
        recall, factor = _DOUBTED
        if self.contrast < _PLAIN:
            return None
        if dim := self.dim(factor if self.recall < recall else 1.0):
            return dim
        return "drops" if self.drops > LIKELY else None

    def dim(self, factor: float = 1.0) -> Code | None:
        """Return whether it is dark, hazy or blurred; a larger factor widens these limits."""
        reasons: dict[Code, bool] = {
            "dark": self.brightness < factor * _DARK,
            "haze": self.contrast < factor * _HAZY * (self.brightness + 5),
            "blur": self.sharpness < factor * _BLURRED,
        }
        return next((code for code, is_so in reasons.items() if is_so), None)

    @property
    def drops(self) -> float:
        """How likely there are drops on the lens, 0 to 1, where it is not dark, hazy or blurred."""
        return _probability("drops", self.looks)

    @property
    def recall(self) -> float:
        """The fraction of the vehicles that the shipped network finds in such pictures."""
        return _probability("recall", (*self.looks, self.weak, self.sure))


def _texture(pixels: Float32Array) -> tuple[float, ...]:
    """Return `Sight.texture` of a plane."""
    soft, softer, edges = (cv2.GaussianBlur(pixels, (0, 0), sigma) for sigma in (0.7, 1.4, 1.0))
    fine = np.abs(pixels - soft)
    few, many = np.quantile(cv2.resize(fine, _TILES, interpolation=cv2.INTER_AREA), (0.1, 0.75))
    x, y = cv2.Sobel(edges, cv2.CV_32F, 1, 0), cv2.Sobel(edges, cv2.CV_32F, 0, 1)
    xx, yy, xy = (cv2.blur(product, (9, 9)) for product in (x * x, y * y, x * y))
    directed = np.hypot(xx - yy, 2 * xy) / (xx + yy + 1)  # coherence of the structure tensor
    light = float(pixels.mean()) + 5
    levels = (float(band.mean()) / light + 0.001 for band in (fine, np.abs(soft - softer)))
    even = (few + 0.05) / (many + 0.05)
    return *(float(np.log(level)) for level in (*levels, even)), float(directed.mean())


@cache
def read_weights() -> dict[str, list[float]]:
    """Return the weights by what they tell; the last of each is the bias."""
    weights = files("vdet.conditions").joinpath("weights.json").read_text(encoding="utf-8")
    return dict(json.loads(weights))


def _probability(name: str, values: Sequence[float]) -> float:
    return float(1 / (1 + np.exp(-np.dot(read_weights()[name], (*values, 1.0)))))


def findings(times: Sequence[float], sights: Sequence[Sight], *, is_shipped: bool) -> list[Finding]:
    """Return from when to when one does not see well, for each reason.

    `is_shipped` says whether the shipped network was used: what it finds is known.
    """
    every = [sight.code for sight in sights]
    codes = [_usual(every[max(0, n - _AROUND) : n + _AROUND + 1]) for n in range(len(every))]
    found = []
    for code, words in _WORDS.items():
        bad = dict.fromkeys(time for time, item in zip(times, codes, strict=True) if item == code)
        spans = [span for span in joined(bad, _GAP) if span[1] - span[0] >= _SHORTEST]
        if not spans:
            continue
        tells, recall = "fewer vehicles are found in such images", None
        if is_shipped:
            seen = [sight.recall for time, sight in zip(times, sights, strict=True) if time in bad]
            recall = float(np.mean(seen))
            tells = f"in such images the network finds about {10 * recall:.0f} of 10 vehicles"
        severity: Severity = "warning" if recall is None or recall < _NOTED else "note"
        text = f"{words} {when(spans)}: {tells}"
        found.append(Finding(code, text, tuple(spans), severity, recall))
    return found


def _usual(codes: Sequence[Code | None]) -> Code | None:
    """Return the most frequent code."""
    return max(codes, key=lambda code: (codes.count(code), code is None))
