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
    costs, row_of = -values, np.full(columns, _FREE)
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
    pairs = ((int(row), column) for column, row in enumerate(row_of) if row != _FREE)
    return sorted((row, column) for row, column in pairs if values[row, column] > 0)
