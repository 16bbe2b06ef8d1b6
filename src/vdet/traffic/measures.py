"""Measures of traffic engineers: peak hours and turning movements.

The peak hour and its factor are those of the Highway Capacity Manual: the four successive quarters
of an hour with the most vehicles, and their number divided by four times that of the busiest.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import get_args

import numpy as np

from vdet.config.scene import Approach, LineSettings
from vdet.traffic.clock import ClockTime, Interval

QUARTER = 900
"""Seconds."""
HEAVY = "truck", "bus"
"""The classes of heavy vehicles."""
HEAVY_NAMED = "of 101 trucks that it found on unseen cameras, the shipped network named 56 right"
"""How far to trust their share; docs/accuracy.md says how it was measured."""
APPROACHES: tuple[Approach, ...] = get_args(Approach)
"""The arms of a junction, clockwise from the north."""
MOVEMENTS = "left", "through", "right", "U-turn"


@dataclass(frozen=True, slots=True)
class PeakHour:
    """When it begins, its number of vehicles, and the peak hour factor, 0.25 to 1."""

    start: ClockTime
    vehicles: int
    factor: float


def peak_hour(quarters: Sequence[Interval], vehicles: Mapping[int, int]) -> PeakHour | None:
    """Return the peak hour; None if no hour is observed completely, or no vehicle passes.

    `vehicles` has their number in each of the `quarters` of an hour, by the number of the quarter.
    """
    peak = None
    for first in range(len(quarters) - 3):
        hour = quarters[first : first + 4]
        numbers = [vehicles.get(quarter.number, 0) for quarter in hour]
        is_complete = hour[3].number - hour[0].number == 3 * QUARTER
        is_complete = is_complete and not any(quarter.is_part for quarter in hour)
        if is_complete and sum(numbers) > (peak.vehicles if peak else 0):
            factor = round(sum(numbers) / (4 * max(numbers)), 2)
            peak = PeakHour(hour[0].start, sum(numbers), factor)
    return peak


def exits(lines: Iterable[LineSettings]) -> set[tuple[str, str]]:
    """Return the directions, with the names of the lines, that lead out of a junction.

    A vehicle leaves by an arm if it goes away from the middle of the lines of all arms.
    """
    arms = [line for line in lines if line.approach]
    ends = [(np.divide(arm.start, arm.size), np.divide(arm.end, arm.size)) for arm in arms]
    middle = np.mean(ends, axis=(0, 1)) if arms else None
    found = set()
    for arm, (start, end) in zip(arms, ends, strict=True):
        (x, y), (to_x, to_y) = end - start, middle - start
        side = x * to_y - y * to_x  # of the middle; y runs down, so right is positive
        if side:
            found.add((arm.name, arm.left if side > 0 else arm.right))
    return found


def movement(origin: Approach, destination: Approach) -> str:
    """Return how a vehicle goes from an arm of a junction to another: one of `MOVEMENTS`."""
    eighths = (APPROACHES.index(destination) - APPROACHES.index(origin)) % len(APPROACHES)
    left, through, right, u_turn = MOVEMENTS
    if eighths in (0, 4):
        return through if eighths else u_turn
    return left if eighths < 4 else right
