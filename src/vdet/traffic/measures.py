"""Measures of traffic engineers: peak hours and turning movements.

The peak hour and its factor are those of the Highway Capacity Manual: the four successive quarters
of an hour with the most vehicles, and their number divided by four times that of the busiest.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import get_args

from vdet.config.scene import Approach
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


def movement(origin: Approach, destination: Approach) -> str:
    """Return how a vehicle goes from an arm of a junction to another: one of `MOVEMENTS`."""
    eighths = (APPROACHES.index(destination) - APPROACHES.index(origin)) % len(APPROACHES)
    left, through, right, u_turn = MOVEMENTS
    if eighths in (0, 4):
        return through if eighths else u_turn
    return left if eighths < 4 else right
