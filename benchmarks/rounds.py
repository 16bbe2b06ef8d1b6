"""Interleaved timing: each task runs once a round, so that a slow moment affects all of them."""

import random
import statistics
import time
from collections.abc import Callable, Mapping

Task = Callable[[], object]


def measure(tasks: Mapping[str, Task], rounds: int) -> dict[str, float]:
    """Run all tasks once to warm up, then `rounds` times; return the median seconds.

    The order changes from round to round: a task may slow down the one that follows it.
    """
    times: dict[str, list[float]] = {name: [] for name in tasks}
    order = random.Random(0)
    for number in range(rounds + 1):
        for name in order.sample(list(tasks), len(tasks)):
            began = time.perf_counter()
            tasks[name]()
            if number:
                times[name].append(time.perf_counter() - began)
    return {name: statistics.median(values) for name, values in times.items()}
