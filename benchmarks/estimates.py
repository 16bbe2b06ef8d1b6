"""How often 95 % intervals of counts hold the true number: simulated surveys with known truth.

    python -m benchmarks.estimates

In each of eight situations, 1,000 samples are drawn, each of traffic and errors of its own. Errors
come together in minutes (gamma-Poisson), as they do when something hides the road; in the situation
"bursts", half of the vehicles are missed in 3 % of the minutes. A line of the table is one group:
how many true vehicles there are, how often its interval holds them, the half of its mean width as a
fraction of them, and the mean number of further spans for 2 %. Where there are several lines, or
vehicles are wrongly named, the groups have lines of their own.
"""

import argparse
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from vdet.review.estimate import draw_spans, estimate
from vdet.traffic.counts import ALL, Estimate, VehicleGroup

CLASSES = {"car": 0.85, "truck": 0.1, "bus": 0.05}


@dataclass(frozen=True)
class Situation:
    """A survey.

    `missed` and `false` are fractions of the vehicles that pass; false events also come without
    traffic, `ghosts` in a minute. `together` is the variance of the rates between minutes, relative
    to their square. `renamed` has the fraction of each class that is named as another. `lines` have
    the part of the traffic at each line, and how often more is missed there. In a fraction `bursts`
    of the minutes, half of the vehicles are missed.
    """

    rates: tuple[float, ...]  # true vehicles a minute, of equal parts of the video
    missed: float
    false: float
    checked: int = 10
    minutes: int = 240
    lines: tuple[tuple[float, float], ...] = ((1.0, 1.0),)
    together: float = 0.5
    ghosts: float = 0.0
    grows: float = 0.0  # how much more is missed for each vehicle a minute, as a fraction
    bursts: float = 0.0
    renamed: Mapping[str, float] = field(default_factory=dict)


SITUATIONS = {
    "few errors": Situation((10,), missed=0.02, false=0.005),
    "many errors": Situation((10,), missed=0.15, false=0.08, together=1.0),
    "rush hour": Situation((4, 8, 30, 25, 6, 2), missed=0.02, false=0.01, grows=0.2, checked=20),
    "two lines": Situation(
        (6, 12), missed=0.05, false=0.02, lines=((1.0, 1.0), (1.0, 1.0)), checked=20
    ),
    "classes": Situation(
        (12,), missed=0.03, false=0.01, checked=20, renamed={"truck": 0.3, "bus": 0.2, "car": 0.02}
    ),
    "empty minutes": Situation(
        (0.02, 0.02, 2, 0.02), missed=0.1, false=0.05, ghosts=0.02, checked=20
    ),
    "a worse line": Situation(
        (10,), missed=0.05, false=0.01, lines=((1.0, 1.0), (1.0, 3.0)), checked=20
    ),
    "a quiet line": Situation(
        (10,), missed=0.05, false=0.01, lines=((1.0, 1.0), (1 / 60, 1.0)), checked=20
    ),
}
BURSTS = {
    f"bursts, {rate} a minute": Situation((rate,), missed=missed, false=0.005, bursts=0.03)
    for rate, missed in ((10, 0.02), (30, 0.02))
}


@dataclass(frozen=True)
class Result:
    """What one sample says of a group, beside the truth."""

    estimate: Estimate
    true: int

    @property
    def holds(self) -> bool:
        return self.estimate.low <= self.true <= self.estimate.high

    @property
    def half(self) -> float:
        return (self.estimate.high - self.estimate.low) / 2


def simulate(situation: Situation, seed: int) -> dict[VehicleGroup, Result]:
    """Return the results of one sample, by group; arrays are (minutes, lines, classes)."""
    rng = np.random.default_rng(seed)
    minutes, names = situation.minutes, list(CLASSES)
    rates = np.repeat(situation.rates, minutes // len(situation.rates))
    shape = 1 / situation.together
    harder = 1 + situation.grows * (rates - rates.min())
    hidden, wrong = (rng.gamma(shape, 1 / shape, minutes) for _ in range(2))
    missing = np.minimum(0.9, situation.missed * harder * hidden)
    missing = np.where(rng.random(minutes) < situation.bursts, 0.5, missing)
    parts, worse = np.array(situation.lines).T[..., np.newaxis]
    shares, of_minute = np.array(list(CLASSES.values())), (slice(None), np.newaxis, np.newaxis)
    traffic = rates[of_minute] * parts * shares
    passed = rng.poisson(traffic)
    # The same minutes are hard at all lines.
    missed = rng.binomial(passed, np.minimum(1.0, worse * missing[of_minute]))
    renamed = rng.binomial(passed - missed, [situation.renamed.get(name, 0.0) for name in names])
    false = rng.poisson(traffic * situation.false * wrong[of_minute] + situation.ghosts * shares)
    renamed_to = np.roll(renamed, 1, axis=2)
    counted = passed - missed - renamed + renamed_to + false
    in_class = np.stack([counted, missed + renamed, false + renamed_to])
    in_line = np.stack([counted, missed, false]).sum(axis=3)
    numbers = {ALL: in_line.sum(axis=2)}
    numbers |= {VehicleGroup(str(n), "in"): in_line[..., n] for n in range(len(parts))}
    numbers |= {VehicleGroup(class_name=n): in_class[..., k].sum(2) for k, n in enumerate(names)}
    true = {group: of_group[0] + of_group[1] - of_group[2] for group, of_group in numbers.items()}
    order = draw_spans(numbers[ALL][0], seed)
    estimates = estimate(numbers, order[: situation.checked], order)
    return {item.group: Result(item, int(true[item.group].sum())) for item in estimates}


def measure(situation: Situation, samples: int) -> dict[str, list[Result]]:
    """Return the results of many samples, by group."""
    by_sample = [simulate(situation, seed) for seed in range(samples)]
    groups = {"all": ALL}
    if len(situation.lines) > 1:
        groups |= {f"line {n + 1}": VehicleGroup(str(n), "in") for n in range(len(situation.lines))}
    if situation.renamed:
        groups |= {name: VehicleGroup(class_name=name) for name in CLASSES}
    return {name: [results[group] for results in by_sample] for name, group in groups.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=1000)
    arguments = parser.parse_args()
    situations = dict(SITUATIONS)
    for name, situation in BURSTS.items():
        for checked in (3, 6, 10, 20):
            situations[f"{name}, {checked}"] = replace(situation, checked=checked)
    print("situation | checked | true | held | ± half width | more for 2 %")
    for name, situation in situations.items():
        for group, results in measure(situation, arguments.samples).items():
            true = np.mean([result.true for result in results])
            half = np.mean([result.half for result in results]) / true
            more = np.mean([result.estimate.minutes_to_precision for result in results])
            held, checked = np.mean([result.holds for result in results]), situation.checked
            row = f"{name}: {group}", checked, f"{true:.0f}", f"{held:.1%}", f"{half:.1%}"
            print(*row, f"{more:.0f}", sep=" | ", flush=True)


if __name__ == "__main__":
    main()
