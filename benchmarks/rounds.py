"""Interleaved timing: each task runs once a round, so that a slow moment affects all of them."""

import statistics
import time
from collections.abc import Callable, Mapping

Task = Callable[[], object]


def measure(tasks: Mapping[str, Task], rounds: int) -> dict[str, float]:
    """Run all tasks once to warm up, then `rounds` times in turn; return the median seconds."""
    times: dict[str, list[float]] = {name: [] for name in tasks}
    for number in range(rounds + 1):
        for name, task in tasks.items():
            began = time.perf_counter()
            task()
            if number:
                times[name].append(time.perf_counter() - began)
    return {name: statistics.median(values) for name, values in times.items()}
