"""Visibility in a video, and what the shipped network finds in such images.

`benchmarks/visibility.py` measures its recall in images of many roads, and writes the weights of
two logistic regressions: for the recall, and for the probability of water on the lens.
"""

import json
from collections import deque
from collections.abc import Iterable, Sequence
from copy import deepcopy
from functools import cache
from importlib.resources import files
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import BoolArray, Float64Array, Image
from vdet.config.schema import Code
from vdet.findings import Finding, Severity
from vdet.traffic.clock import GAP, Span, extend, when

Codes = npt.NDArray[np.str_]
"""Reasons for poor visibility, `(n,)`: keys of `WORDS`, empty where visibility is good."""
WORDS: dict[Code, str] = {
    "dark": "it is dark",
    "haze": "contrast is low, as in fog or spray",
    "blur": "the image is blurred",
    "drops": "there is water or dirt on the lens",
}
PLAIN = 7
"""Number of measures that do not depend on the detector: the first ones of `measure`."""
LIKELY = 0.9
"""Minimum probability of water on the lens to report it."""
_TOP = 0.35
"""Start of the part of the plane that shows a road, as a fraction of its height."""
_LIGHT = 5.0
"""Added to the mean of a plane before taking its logarithm, grey levels."""
_DARK = 45.0
"""Maximum mean of a dark plane, grey levels."""
_HAZY = 0.07
"""Maximum local contrast of a hazy plane, as a fraction of the mean."""
_BLURRED = 0.3
"""Maximum fine contrast of a blurred plane, as a fraction of the coarse contrast."""
_DOUBTED, _WIDER = 0.5, 1.2
"""Recall below which these limits are widened, because scores agree, and the factor."""
_EMPTY = 1.0
"""Maximum local contrast of a plane that shows nothing, grey levels."""
_SHORTEST = 3.0
"""Minimum seconds of poor visibility to report it; an underpass is shorter."""
_AROUND = 5
"""Number of neighbouring planes whose most frequent reason counts."""
_SURE = 0.4
"""Minimum score of a sure detection."""
_MIN_RECALL = 0.6
"""Minimum recall at which poor visibility is only a note."""
_TILES = 16, 9
"""Tiles of a plane whose fine contrast is compared: columns, rows."""


def measure(fine_plane: Image, plane: Image, scores: Float64Array) -> Float64Array:
    """Measure the visibility in a frame, from two of its planes, uint8.

    `scores` are those of all its detections.

    Returns
    -------
    float64 `(9,)`: logarithms of the mean, of the local contrast, and of the fine contrast per
    coarse contrast, where the frame shows a road; logarithms of the finest and the next contrast of
    the whole frame, and of how even the finest is; how much edges have one direction; the fraction
    of all scores that weak detections have, and the mean score of the others. Water is soft,
    everywhere, and has edges of all directions.
    """
    lower = plane[int(_TOP * len(plane)) :].astype(np.float32)
    squares = cv2.blur(lower * lower, (15, 15)) - cv2.blur(lower, (15, 15)) ** 2
    contrast = np.sqrt(np.maximum(squares, 0)).mean()
    fine, coarse = (np.abs(lower - cv2.GaussianBlur(lower, (0, 0), s)).mean() for s in (1, 4))
    seen = np.log(np.maximum((lower.mean() + _LIGHT, contrast, fine / max(coarse, 0.3)), 0.05))
    is_sure = scores >= _SURE
    weak = scores[~is_sure].sum() / max(scores.sum(), 0.1)
    sure = scores[is_sure].mean() if is_sure.any() else _SURE
    return np.array([*seen, *_texture(fine_plane), weak, sure], np.float64)


def _texture(plane: Image) -> tuple[float, ...]:
    """Return the measures of the whole frame, which reveal water on the lens."""
    pixels = plane.astype(np.float32)
    soft, softer, edges = (cv2.GaussianBlur(pixels, (0, 0), sigma) for sigma in (0.7, 1.4, 1.0))
    fine = np.abs(pixels - soft)
    few, many = np.quantile(cv2.resize(fine, _TILES, interpolation=cv2.INTER_AREA), (0.1, 0.75))
    x, y = cv2.Sobel(edges, cv2.CV_32F, 1, 0), cv2.Sobel(edges, cv2.CV_32F, 0, 1)
    xx, yy, xy = (cv2.blur(product, (9, 9)) for product in (x * x, y * y, x * y))
    directed = np.hypot(xx - yy, 2 * xy) / (xx + yy + 1)  # coherence of the structure tensor
    levels = np.array((fine.mean(), np.abs(soft - softer).mean())) / (pixels.mean() + _LIGHT)
    even = np.log((few + 0.05) / (many + 0.05))
    return *np.log(levels + 0.001), even, directed.mean()


def dim(measures: Float64Array, factor: float | Float64Array = 1.0) -> Codes:
    """Return where it is dark, hazy or blurred; a larger factor widens these limits."""
    light, contrast, sharpness = np.exp(measures[:, :3].T)
    is_dark, is_hazy = light < factor * _DARK + _LIGHT, contrast < factor * _HAZY * light
    is_blurred = sharpness < factor * _BLURRED
    return np.select((is_dark, is_hazy, is_blurred), ("dark", "haze", "blur"), "")


def reasons(measures: Float64Array, wet: BoolArray | bool = False) -> Codes:
    """Return the reasons for poor visibility in frames.

    `measures` are `(n, 9)`; `wet` `(n,)` says where sharp drops were recognized on the glass.
    """
    recall = probability(read_weights()["recall"], measures)
    codes = dim(measures, np.where(recall < _DOUBTED, _WIDER, 1.0))
    has_water = probability(read_weights()["drops"], measures[:, :PLAIN]) > LIKELY
    codes = np.where(wet | (codes == "") & has_water, "drops", codes)
    return np.where(measures[:, 1] < np.log(_EMPTY), "", codes)


@cache
def read_weights() -> dict[str, list[float]]:
    """Return the weights of both regressions by name; the last of each is the bias."""
    weights = files("vdet.conditions").joinpath("weights.json").read_text(encoding="utf-8")
    return dict(json.loads(weights))


def probability(weights: Sequence[float], measures: Float64Array) -> Float64Array:
    """Return the probability that a logistic regression predicts for each row, `(n,)`."""
    return np.asarray(1 / (1 + np.exp(-(measures @ weights[:-1] + weights[-1]))))


class VisibilityWatch:
    """Watches the visibility in one video, in figures that do not grow.

    Parameters
    ----------
    is_shipped
        Whether the shipped network is used, whose recall is known.
    """

    def __init__(self, *, is_shipped: bool) -> None:
        self._is_shipped = is_shipped
        self._latest = deque[_Look](maxlen=_AROUND)
        self._is_enough = False  # whether there are `_AROUND` planes
        self._spans = {code: list[Span]() for code in WORDS}
        self._recalls = {code: [0.0, 0] for code in WORDS}  # sums and numbers

    def add(self, time: float, measures: Float64Array, *, is_wet: bool) -> bool:
        """Add a plane with its measures, `(9,)`; return whether visibility is good in it.

        `is_wet` as in `reasons`.
        """
        code = str(reasons(measures[np.newaxis], is_wet)[0])
        recall = float(probability(read_weights()["recall"], measures))
        self._latest.append(_Look(time, code, recall))
        self._is_enough = self._is_enough or len(self._latest) == _AROUND
        if len(self._latest) > _AROUND // 2:
            self._count(self._latest[-1 - _AROUND // 2], self._latest)
        return not code

    def _count(self, look: "_Look", nearby: Iterable["_Look"]) -> None:
        """Count a plane with the most frequent reason of those around it."""
        codes = [each.code for each in nearby]
        usual = max(("", *WORDS), key=codes.count)
        for code in WORDS:
            if code == usual:
                extend(self._spans[code], look.time, GAP)
                self._recalls[code][0] += look.recall
                self._recalls[code][1] += 1
            elif (spans := self._spans[code]) and look.time - spans[-1][1] > GAP:
                spans[-1:] = [span for span in spans[-1:] if span[1] - span[0] >= _SHORTEST]

    def findings(self) -> list[Finding]:
        """Return when visibility was poor so far, for each reason."""
        reported: list[Finding] = []
        if not self._is_enough:
            return reported
        whole, latest = deepcopy(self), list(self._latest)
        for number in range(_AROUND // 2, 0, -1):
            whole._count(latest[-number], latest[_AROUND // 2 + 1 - number :])
        for code, words in WORDS.items():
            spans = tuple(span for span in whole._spans[code] if span[1] - span[0] >= _SHORTEST)
            if not spans:
                continue
            part, effect = None, "fewer vehicles are detected in such images"
            if self._is_shipped:
                part = whole._recalls[code][0] / whole._recalls[code][1]
                effect = f"in such images the network finds about {10 * part:.0f} of 10 vehicles"
            severity: Severity = "note" if part and part >= _MIN_RECALL else "warning"
            text = f"{words} {when(spans)}: {effect}"
            reported.append(Finding(code, text, spans, severity, part))
        return reported


class _Look(NamedTuple):
    """A plane: its time, the reason for poor visibility, and the recall of the network."""

    time: float
    code: str
    recall: float
