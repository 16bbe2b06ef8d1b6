"""Pairs of rows and columns with the largest sum of values.

`scipy.optimize.linear_sum_assignment` does the same, but importing it costs every run about 50 MB
and a part of its start. Source: Jonker and Volgenant, "A Shortest Augmenting Path Algorithm for
Dense and Sparse Linear Assignment Problems", 1987, without its first phases.
"""

import numpy as np

from vdet.boxes import Float64Array

_FREE = -1


def assign(values: Float64Array) -> list[tuple[int, int]]:
    """Return the pairs of row and column, each used at most once, with the largest sum.

    Parameters
    ----------
    values
        Float64 `(n, m)`, at least 0; pairs of value 0 are left out.
    """
    rows, columns = values.shape
    if rows > columns:
        return sorted((row, column) for column, row in assign(values.T))
    solver = _Solver(values)
    for row in range(rows):
        solver.add(row)
    pairs = ((int(row), column) for column, row in enumerate(solver.row_of) if row != _FREE)
    return sorted((row, column) for row, column in pairs if values[row, column] > 0)


class _Solver:
    """The best pairs of the rows added so far, and their dual variables."""

    def __init__(self, values: Float64Array) -> None:
        rows, columns = values.shape
        self._costs = -values
        self._of_rows, self._of_columns = np.zeros(rows), np.zeros(columns)
        self.row_of = np.full(columns, _FREE)

    def add(self, row: int) -> None:
        """Pair one more row; others change their columns along the cheapest path."""
        columns = len(self.row_of)
        lengths, previous = np.full(columns, np.inf), np.full(columns, _FREE)
        is_open = np.ones(columns, np.bool_)
        current, column, shortest = row, _FREE, 0.0
        while current != _FREE:
            reached = shortest + self._costs[current] - self._of_rows[current] - self._of_columns
            shorter = is_open & (reached < lengths)
            lengths[shorter], previous[shorter] = reached[shorter], column
            column = int(np.where(is_open, lengths, np.inf).argmin())
            shortest, is_open[column] = float(lengths[column]), False
            current = int(self.row_of[column])
        self._of_rows[row] += shortest
        passed = ~is_open
        passed[column] = False
        change = shortest - lengths[passed]
        self._of_rows[self.row_of[passed]] += change
        self._of_columns[passed] -= change
        while column != _FREE:
            before = int(previous[column])
            self.row_of[column] = row if before == _FREE else self.row_of[before]
            column = before
