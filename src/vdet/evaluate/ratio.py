"""Division as the benchmarks do it."""


def ratio(part: float, whole: float) -> float:
    """Return `part / whole`; 0 where there is nothing to divide by, as TrackEval has it."""
    return float(part / whole) if whole else 0.0
