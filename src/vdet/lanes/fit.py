"""Curves through paint, by least squares: the evidence of a frame, and of several together.

The curves (`curves`) are linear in their five numbers, but for two products with the pitch, where
a guess stands for the other factor. Every row of paint weighs the same. The normal equations of
frames simply add up, so frames before count with less weight and no fit is done twice.
"""

from dataclasses import dataclass

import numpy as np

from vdet.geometry import Float64Array
from vdet.lanes.curves import Curves, Paint, seen_width

_PITCH = 4  # its place among the five numbers, in the order of `Curves`

# What is known without paint, as a number of rows of paint (0.1 m each) with a usual deviation:
_BEND_WEIGHT = (0.1 / 0.001) ** 2
_PITCH_WEIGHT = (0.1 / 0.003) ** 2
_WIDTH_WEIGHT = (0.1 / 0.2) ** 2
_ANY_WEIGHT = 1e-3  # keeps the equations solvable


@dataclass(frozen=True, slots=True)
class Evidence:
    """Normal equations of a fit, `(5, 5)` and `(5,)`."""

    matrix: Float64Array
    vector: Float64Array

    def with_earlier(self, earlier: "Evidence", memory: float) -> "Evidence":
        """Return this evidence with `memory` × what an earlier one says of all but the pitch.

        A car's pitch changes from frame to frame, its place and the road do not; the earlier pitch
        is eliminated (Schur complement).
        """
        share = earlier.matrix[:, _PITCH] / (earlier.matrix[_PITCH, _PITCH] + _PITCH_WEIGHT)
        matrix = earlier.matrix - np.outer(share, earlier.matrix[_PITCH])
        vector = earlier.vector - share * earlier.vector[_PITCH]
        matrix[_PITCH] = matrix[:, _PITCH] = vector[_PITCH] = 0
        return Evidence(self.matrix + memory * matrix, self.vector + memory * vector)


def gather(left: Paint, right: Paint, guess: Curves) -> Evidence:
    """Return what the paint of both lines says about the curves."""
    rows = np.concatenate(
        [_rows(left, (1, 0), guess.left, guess), _rows(right, (0, 1), guess.right, guess)]
    )
    return Evidence(rows.T @ rows, rows.T @ np.concatenate([left.x, right.x]))


def solve(evidence: Evidence, width: float) -> Curves:
    """Return the curves that agree best with the evidence.

    Where there is little of it, the road is rather straight and level, and the lane of this width.
    """
    apart = np.array([0, 0, -1, 1, 0])
    known = np.diag([_BEND_WEIGHT, _ANY_WEIGHT, _ANY_WEIGHT, _ANY_WEIGHT, _PITCH_WEIGHT])
    known += _WIDTH_WEIGHT * np.outer(apart, apart)
    vector = evidence.vector + _WIDTH_WEIGHT * width * apart
    return Curves(*np.linalg.solve(evidence.matrix + known, vector).tolist())


def _rows(paint: Paint, side: tuple[int, int], place: float, guess: Curves) -> Float64Array:
    """Return the coefficients of the five numbers at each row of a line's paint, `(n, 5)`."""
    rows = np.empty((len(paint.z), 5))
    rows[:, 0] = paint.z**2 / seen_width(paint.z, guess.pitch)
    rows[:, 1] = paint.z
    rows[:, 2:4] = side
    rows[:, _PITCH] = -place * paint.z
    return rows
