"""What the search of a grid gives."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vdet.detect.svm.features import Vectors
from vdet.geometry import Float32Array

Numbers = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Scored:
    """The probability of each window of a grid, and the HOG of those that one asks for.

    `probabilities` is float32 of shape `(n,)`. `hogs` takes numbers of windows, shape `(m,)`, and
    returns their HOG features as `FeatureExtractor` gives them, float32 `(m, h)`.
    """

    probabilities: Float32Array
    hogs: Callable[[Numbers], Vectors]
