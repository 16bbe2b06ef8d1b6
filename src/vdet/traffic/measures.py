"""Measures of traffic engineers: peak hours, heavy vehicles, passenger car units, turns.

The peak hour and its factor are those of the Highway Capacity Manual: the four successive quarters
of an hour with the most vehicles, and that number divided by four times that of the busiest one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import get_args

from vdet.config.shapes import Approach
from vdet.traffic.clock import ClockTime, Interval

QUARTER = 900
"""Seconds."""
HEAVY = frozenset(("truck", "bus"))
"""The classes of heavy vehicles."""
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
    hours = (quarters[first : first + 4] for first in range(len(quarters) - 3))
    complete = [
        hour
        for hour in hours
        if hour[3].number - hour[0].number == 3 * QUARTER
        and not any(quarter.is_part for quarter in hour)
    ]
    numbers = [[vehicles.get(quarter.number, 0) for quarter in hour] for hour in complete]
    total = max(map(sum, numbers), default=0)
    if not total:
        return None
    busiest = next(index for index, hour in enumerate(numbers) if sum(hour) == total)
    factor = total / (4 * max(numbers[busiest]))
    return PeakHour(complete[busiest][0].start, total, factor)


def heavy_share(numbers: Mapping[str, int]) -> float | None:
    """Return the fraction of heavy vehicles, by the number of each class; None without any."""
    total = sum(numbers.values())
    return sum(numbers.get(name, 0) for name in HEAVY) / total if total else None


def passenger_car_units(numbers: Mapping[str, int], units: Mapping[str, float]) -> float:
    """Return the passenger car units of vehicles, by class; a class that has none counts as 1."""
    return sum(number * units.get(name, 1.0) for name, number in numbers.items())


def movement(origin: Approach, destination: Approach) -> str:
    """Return how a vehicle goes from an arm of a junction to another: one of `MOVEMENTS`."""
    eighths = (APPROACHES.index(destination) - APPROACHES.index(origin)) % len(APPROACHES)
    left, through, right, u_turn = MOVEMENTS
    if eighths in (0, 4):
        return through if eighths else u_turn
    return left if eighths < 4 else right
