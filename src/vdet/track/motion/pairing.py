"""Assignment of detections to vehicles, by position and appearance.

Source: the order of the rounds is the matching cascade of Wojke, Bewley and Paulus, "Simple Online
and Realtime Tracking with a Deep Association Metric", 2017; the buffered intersection over union is
that of Yang et al., "Hard to Track Objects with Irregular Motions and Similar Appearances? Make It
Easier by Buffering the Matching Space", 2023.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from vdet.boxes import Float64Array, Int64Array, iou
from vdet.media import Picture

WIDEST_BUFFER = 0.25
"""Maximum widening of a box on each side, fraction of its size."""

_FREE = -1

_MARGIN = 0.15
"""Fraction of width and height omitted at each side of a box: much of it is background."""

_UNITS = 20.0, 6.0, 6.0
"""Differences of luma, blue and red chroma, in levels, that count as one unit.

Most vehicles differ from each other by more, and from themselves a second ago by less.
"""


def buffered_iou(
    expected: Float64Array, buffers: Float64Array, detected: Float64Array
) -> Float64Array:
    """Return how well each expected box fits each detected one, 0 to 1, `(n, m)`.

    Both boxes are widened by the buffer of the expected one, in fractions of their own sizes, so
    boxes that do not touch can still match if the motion is uncertain.

    Parameters
    ----------
    expected, detected
        Shapes `(n, 4)` and `(m, 4)`: x1, y1, x2, y2 in pixels, each with an area.
    buffers
        Shape `(n, 2)`: fractions of width and height by which a box is widened on each side.
    """
    fractions = np.minimum(buffers, WIDEST_BUFFER)[:, np.newaxis]
    return iou(_widened(expected[:, np.newaxis], fractions), _widened(detected, fractions))


def _widened(boxes: Float64Array, fractions: Float64Array | float) -> Float64Array:
    start, end = boxes[..., :2], boxes[..., 2:]
    margin = (end - start) * fractions
    return np.concatenate([start - margin, end + margin], axis=-1)


def appearances(picture: Picture | None, boxes: Float64Array) -> Float64Array:
    """Return the mean luma, blue and red chroma of the upper and the lower half of each box.

    Parameters
    ----------
    picture
        None if unknown.
    boxes
        float64 `(n, 4)`: x1, y1, x2, y2 in pixels, inside the picture, with an area.

    Returns
    -------
    float64 `(n, 2, 3)`: levels from 0 to 255, as in the planes; NaN without a picture.
    """
    if picture is None or not len(boxes):
        return np.full((len(boxes), 2, 3), np.nan)
    inner = _widened(boxes, -_MARGIN)
    halves = np.stack([inner, inner], axis=1)
    halves[:, 0, 3] = halves[:, 1, 1] = inner[:, [1, 3]].mean(axis=1)
    means = [picture.mean_color(half) for half in halves.reshape(-1, 4)]
    return np.reshape(means, (-1, 2, 3))


def differences(a: Float64Array, b: Float64Array) -> Float64Array:
    """Return the difference of appearances, `(…, 2, 3)`: 0 if they are equal or unknown."""
    units = (a - b) / _UNITS
    return np.asarray(np.sqrt(np.nan_to_num(units**2).mean(axis=(-2, -1))))


def pair(values: Float64Array, rounds: Sequence[Sequence[int]]) -> dict[int, int]:
    """Pair rows with columns, each at most once.

    Parameters
    ----------
    values
        Shape `(n, m)`: the value of a pair; 0 if it is not allowed.
    rounds
        Rows; those of a later round choose from the columns left by the earlier ones.

    Returns
    -------
    The column of each paired row; each round maximizes the sum of values.
    """
    remaining = values.copy()
    pairs: dict[int, int] = {}
    for rows in rounds:
        paired, columns = assign(remaining[list(rows)])
        pairs |= {rows[row]: column for row, column in zip(paired, columns.tolist(), strict=True)}
        remaining[:, list(pairs.values())] = 0
    return pairs


def assign(values: npt.NDArray[Any]) -> tuple[Int64Array, Int64Array]:
    """Pair rows with columns, each at most once, to maximize the sum of the values.

    Same as `scipy.optimize.linear_sum_assignment`, whose import would cost every run about 50 MB
    and startup time. Source: Jonker and Volgenant, "A Shortest Augmenting Path Algorithm for Dense
    and Sparse Linear Assignment Problems", 1987, without its first phases.

    Parameters
    ----------
    values
        Shape `(n, m)`, at least 0.

    Returns
    -------
    Rows and columns of the pairs with a value above 0, rows ascending.
    """
    rows, columns = len(values), max(values.shape)  # each row gets a column, perhaps an added one
    costs, row_of = np.zeros((rows, columns)), np.full(columns, _FREE)
    costs[:, : values.shape[1]] -= values
    of_rows, of_columns = np.zeros(rows), np.zeros(columns)  # the dual variables
    for row in range(rows):
        # Search the cheapest path from this row to a free column.
        lengths, previous = np.full(columns, np.inf), np.full(columns, _FREE)
        is_open = np.ones(columns, np.bool_)
        current, column, shortest = row, _FREE, 0.0
        while current != _FREE:
            reached = shortest + costs[current] - of_rows[current] - of_columns
            shorter = is_open & (reached < lengths)
            lengths[shorter], previous[shorter] = reached[shorter], column
            column = int(np.where(is_open, lengths, np.inf).argmin())
            shortest, is_open[column] = float(lengths[column]), False
            current = int(row_of[column])
        passed = np.flatnonzero(~is_open & (row_of != _FREE))
        change = shortest - lengths[passed]
        of_rows[row] += shortest
        of_rows[row_of[passed]] += change
        of_columns[passed] -= change
        # The rows along the path change their columns.
        while column != _FREE:
            before = int(previous[column])
            row_of[column] = row if before == _FREE else row_of[before]
            column = before
    column_of, used = np.empty(rows, np.int64), np.flatnonzero(row_of != _FREE)
    column_of[row_of[used]] = used
    paired = np.flatnonzero(costs[np.arange(rows), column_of] < 0)
    return paired, column_of[paired]
