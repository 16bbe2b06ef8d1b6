"""Which region belongs to which vehicle.

Source: Kuhn, "The Hungarian Method for the Assignment Problem", 1955; the order of the rounds is
the matching cascade of Wojke, Bewley and Paulus, "Simple Online and Realtime Tracking with a Deep
Association Metric", 2017.
"""

from collections.abc import Sequence

from scipy.optimize import linear_sum_assignment  # type: ignore[import-untyped]

from vdet.geometry import Float64Array

Pairs = dict[int, int]


def pair(scores: Float64Array, rounds: Sequence[Sequence[int]]) -> Pairs:
    """Pair rows with columns, each at most once.

    Parameters
    ----------
    scores
        Shape `(n, m)`: what a pair is worth; 0 where it must not be.
    rounds
        Rows: those of a later round may only have what the earlier ones left.

    Returns
    -------
    The column of each paired row: in each round those pairs whose scores add up to most.
    """
    left = scores.copy()
    pairs: Pairs = {}
    for rows in rounds:
        pairs |= {rows[row]: column for row, column in _assign(left[list(rows)])}
        left[:, list(pairs.values())] = 0
    return pairs


def _assign(scores: Float64Array) -> list[tuple[int, int]]:
    rows, columns = linear_sum_assignment(scores, maximize=True)
    kept = scores[rows, columns] > 0
    return list(zip(rows[kept].tolist(), columns[kept].tolist(), strict=True))
