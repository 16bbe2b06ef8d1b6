"""From the strength of the evidence to a score: the share of such boxes that are vehicles."""

import numpy as np

from vdet.geometry import Float32Array


def detection_scores(strengths: Float32Array, middle: float, slope: float) -> Float32Array:
    """Return 1 / (1 + (middle / strength) ** slope), float32 `(n,)`, 0 to 1.

    This is a sigmoid of the strength's logarithm (Platt 1999, "Probabilistic outputs for support
    vector machines"). A strength of 0 has the score 0.
    """
    with np.errstate(divide="ignore", over="ignore"):
        odds = (middle / strengths.astype(np.float64)) ** slope
    return np.asarray(1 / (1 + odds), np.float32)
