"""Interleaved timing: every subject once a round, so that a slow moment hits all of them."""

import statistics
import time
from collections.abc import Callable, Mapping

Subject = Callable[[], float | None]
"""Does its work; returns its own measure, or None to be timed."""


def measure(subjects: Mapping[str, Subject], rounds: int) -> dict[str, float]:
    """Run all subjects once to warm up, then `rounds` times in turn; return the medians."""
    times: dict[str, list[float]] = {name: [] for name in subjects}
    for number in range(rounds + 1):
        for name, subject in subjects.items():
            began = time.perf_counter()
            own = subject()
            if number:
                times[name].append(time.perf_counter() - began if own is None else own)
    return {name: statistics.median(values) for name, values in times.items()}
