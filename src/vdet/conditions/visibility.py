"""How well one sees in the parts of a video, and what the shipped network finds in such pictures.

`benchmarks/conditions.py` measures what it finds in pictures of many roads. The recall is fitted
to how bright, contrasty and sharp they are, and to how sure the network is of what it finds.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from vdet.boxes import Float64Array, Image
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
"""Seconds of bad sight that are reported, or half of a shorter video; an underpass is shorter."""
_GAP = 2.0
"""Seconds of good sight that end a span."""
_AROUND = 2
"""Number of planes before and after one whose reasons count with its own."""
_SURE = 0.4
"""Score of a vehicle that is shown."""
_NOTED = 0.6
"""Recall from which bad sight is only noted."""
_WEIGHTS = np.array([-0.11, 0.68, 1.83, -4.19, 3.34])
_BIAS = -0.84
"""Of the logarithms of brightness, contrast and sharpness, the weak fraction of all scores, and the
mean of the others: fitted by `benchmarks/conditions.py`."""

_WORDS: dict[Code, str] = {
    "dark": "it is dark",
    "haze": "contrast is low, as in fog or spray",
    "blur": "the picture is not sharp",
}


@dataclass(frozen=True, slots=True)
class Sight:
    """How well one sees in a plane; the first three are grey levels, or ratios of them."""

    brightness: float
    contrast: float
    sharpness: float
    weak: float
    sure: float

    @classmethod
    def of(cls, plane: Image, scores: Float64Array) -> "Sight":
        """Measure a plane, uint8 `(h, w)`; `scores` are those of all detections in its frame."""
        lower = plane[int(_TOP * len(plane)) :].astype(np.float32)
        squares = cv2.blur(lower * lower, (15, 15)) - cv2.blur(lower, (15, 15)) ** 2
        contrast = float(np.sqrt(np.maximum(squares, 0)).mean())
        fine, coarse = (
            float(np.abs(lower - cv2.GaussianBlur(lower, (0, 0), sigma)).mean()) for sigma in (1, 4)
        )
        is_sure = scores >= _SURE
        weak = float(scores[~is_sure].sum() / max(scores.sum(), 0.1))
        sure = float(scores[is_sure].mean()) if is_sure.any() else _SURE
        return cls(float(lower.mean()), contrast, fine / max(coarse, 0.3), weak, sure)

    @property
    def code(self) -> Code | None:
        """Why one does not see well; None if one does."""
        if self.contrast < _PLAIN:
            return None
        recall, factor = _DOUBTED
        wide = factor if self.recall < recall else 1.0
        if self.brightness < wide * _DARK:
            return "dark"
        if self.contrast < wide * _HAZY * (self.brightness + 5):
            return "haze"
        return "blur" if self.sharpness < wide * _BLURRED else None

    @property
    def recall(self) -> float:
        """The fraction of the vehicles that the shipped network finds in such pictures."""
        seen = np.log(np.maximum((self.brightness + 5, self.contrast, self.sharpness), 0.05))
        return float(1 / (1 + np.exp(-(_WEIGHTS @ (*seen, self.weak, self.sure) + _BIAS))))


def findings(times: Sequence[float], sights: Sequence[Sight], *, is_shipped: bool) -> list[Finding]:
    """Return from when to when one does not see well, for each reason.

    `is_shipped` says whether the shipped network was used: what it finds is known.
    """
    codes = [_usual(sights[max(0, n - _AROUND) : n + _AROUND + 1]) for n in range(len(sights))]
    found = []
    for code, words in _WORDS.items():
        bad = dict.fromkeys(time for time, item in zip(times, codes, strict=True) if item == code)
        spans = [span for span in joined(bad, _GAP) if span[1] - span[0] >= _SHORTEST]
        if not spans:
            continue
        tells, recall = "fewer vehicles are found in such pictures", None
        if is_shipped:
            seen = [sight.recall for time, sight in zip(times, sights, strict=True) if time in bad]
            recall = float(np.mean(seen))
            tells = f"in such pictures the network finds about {10 * recall:.0f} of 10 vehicles"
        severity: Severity = "warning" if recall is None or recall < _NOTED else "note"
        text = f"{words} {when(spans)}: {tells}"
        found.append(Finding(code, text, tuple(spans), severity, recall))
    return found


def _usual(sights: Sequence[Sight]) -> Code | None:
    """Return the code that most of them have."""
    codes = [sight.code for sight in sights]
    return max(codes, key=lambda code: (codes.count(code), code is None))
