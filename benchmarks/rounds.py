"""Interleaved timing: each task runs once a round, so that a slow moment affects all of them."""

import os
import random
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Mapping

Task = Callable[[], object]


def measure(tasks: Mapping[str, Task], rounds: int) -> dict[str, float]:
    """Return the median seconds of wall time of each task: see `measure_both`."""
    return {name: wall for name, (wall, _) in measure_both(tasks, rounds).items()}


def measure_both(tasks: Mapping[str, Task], rounds: int) -> dict[str, tuple[float, float]]:
    """Run all tasks once to warm up, then `rounds` times.

    Return the median seconds of wall time and of processor time, with that of child processes. The
    order changes from round to round: a task may slow down the one that follows it.
    """
    walls: dict[str, list[float]] = {name: [] for name in tasks}
    busy: dict[str, list[float]] = {name: [] for name in tasks}
    order = random.Random(0)
    for number in range(rounds + 1):
        for name in order.sample(list(tasks), len(tasks)):
            began, worked = time.perf_counter(), _processor_time()
            tasks[name]()
            if number:
                walls[name].append(time.perf_counter() - began)
                busy[name].append(_processor_time() - worked)
    return {name: (statistics.median(walls[name]), statistics.median(busy[name])) for name in tasks}


def seconds_of(*arguments: str) -> float:
    """Return the processor time of Python with these arguments, which must succeed."""
    before = os.times()
    subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL)
    return sum(b - a for a, b in zip(before[2:4], os.times()[2:4], strict=True))


def _processor_time() -> float:
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime
