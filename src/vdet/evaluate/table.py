"""Tables as plain text, and numbers as people read them."""

from collections.abc import Sequence

ABSENT = "–"


def table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return aligned lines, headings first: the first column to the left, the others to the right.

    Parameters
    ----------
    headings
        One a column.
    rows
        Each with a text a column.
    """
    widths = [max(map(len, column)) for column in zip(headings, *rows, strict=True)]
    return [_line(row, widths) for row in (headings, *rows)]


def _line(row: Sequence[str], widths: Sequence[int]) -> str:
    first, *others = zip(row, widths, strict=True)
    cells = [first[0].ljust(first[1]), *(text.rjust(width) for text, width in others)]
    return "  ".join(cells).rstrip()


def share(value: float | None, digits: int = 3) -> str:
    """Write a ratio; a dash where there is none."""
    return ABSENT if value is None else f"{value:.{digits}f}"
