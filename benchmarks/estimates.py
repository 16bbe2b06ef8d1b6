"""How often 95 % intervals of counts hold the true number: simulated surveys with known truth.

    python -m benchmarks.estimates

In each of six situations, 1,000 samples are drawn, each of traffic and errors of its own. Errors
come together in minutes (gamma-Poisson), as they do when something hides the road. A line of the
table is one group: how many true vehicles there are, how often its interval holds them, the half of
its mean width and its mean error as a fraction of them, and the mean number of further minutes for
2 %. In the situation "classes", groups of vehicles that are wrongly named have lines of their own.
"""

import argparse
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from vdet.traffic.estimate import CountError, Estimate, estimate
from vdet.traffic.sample import draw_minutes

CLASSES = {"car": 0.85, "truck": 0.1, "bus": 0.05}


@dataclass(frozen=True)
class Situation:
    """A survey.

    `missed` and `false` are fractions of the vehicles that pass; false events also come without
    traffic, `ghosts` in a minute. `together` is the variance of the rates between minutes, relative
    to their square. `renamed` has the fraction of each class that is named as another.
    """

    rates: tuple[float, ...]  # true vehicles a minute, of equal parts of the video
    missed: float
    false: float
    checked: int = 10
    minutes: int = 240
    lines: int = 1
    together: float = 0.5
    ghosts: float = 0.0
    grows: float = 0.0  # how much more is missed for each vehicle a minute, as a fraction
    renamed: Mapping[str, float] = field(default_factory=dict)


SITUATIONS = {
    "few errors": Situation((10,), missed=0.02, false=0.005),
    "many errors": Situation((10,), missed=0.15, false=0.08, together=1.0),
    "rush hour": Situation((4, 8, 30, 25, 6, 2), missed=0.02, false=0.01, grows=0.2, checked=20),
    "two lines": Situation((6, 12), missed=0.05, false=0.02, lines=2, checked=20),
    "classes": Situation(
        (12,), missed=0.03, false=0.01, checked=20, renamed={"truck": 0.3, "bus": 0.2, "car": 0.02}
    ),
    "empty minutes": Situation(
        (0.02, 0.02, 2, 0.02), missed=0.1, false=0.05, ghosts=0.02, checked=20
    ),
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


def simulate(situation: Situation, seed: int) -> dict[str, Result]:
    """Return the results of one sample, by group."""
    rng = np.random.default_rng(seed)
    minutes, names = situation.minutes, list(CLASSES)
    rates = np.repeat(situation.rates, minutes // len(situation.rates))
    shape = 1 / situation.together
    harder = 1 + situation.grows * (rates - rates.min())
    hidden, wrong = (rng.gamma(shape, 1 / shape, minutes) for _ in range(2))
    missing = np.minimum(0.9, situation.missed * harder * hidden)
    counted = np.zeros((len(names), minutes), int)
    true = np.zeros_like(counted)
    errors: list[CountError] = []
    for minute in range(minutes):
        for _ in range(situation.lines):  # the same minutes are hard at both
            false = rates[minute] * situation.false * wrong[minute] + situation.ghosts
            for kind in rng.choice(3, rng.poisson(false), p=list(CLASSES.values())):
                counted[kind, minute] += 1
                errors.append(CountError(minute, names[kind], None))
            for kind in rng.choice(3, rng.poisson(rates[minute]), p=list(CLASSES.values())):
                true[kind, minute] += 1
                name, shown = names[kind], kind
                if rng.random() < missing[minute]:
                    errors.append(CountError(minute, None, name))
                    continue
                if rng.random() < situation.renamed.get(name, 0):
                    shown = (kind + 1) % 3
                    errors.append(CountError(minute, names[shown], name))
                counted[shown, minute] += 1
    order = draw_minutes([int(number) for number in counted.sum(axis=0)], seed)
    checked = set(order[: situation.checked])
    table = {name: [int(n) for n in row] for name, row in zip(names, counted, strict=True)}
    seen = [error for error in errors if error.minute in checked]
    estimates = estimate(table, seen, checked, order)
    totals = {None: true.sum()} | dict(zip(names, true.sum(axis=1), strict=True))
    return {item.group or "all": Result(item, int(totals[item.group])) for item in estimates}


def measure(situation: Situation, samples: int) -> dict[str, list[Result]]:
    """Return the results of many samples, by group."""
    by_sample = [simulate(situation, seed) for seed in range(samples)]
    groups = by_sample[0] if situation.renamed else ["all"]
    return {group: [results[group] for results in by_sample] for group in groups}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=1000)
    arguments = parser.parse_args()
    print("| situation | checked | true | held | ± half width | mean error | more for 2 % |")
    print("|---|---|---|---|---|---|---|")
    for name, situation in SITUATIONS.items():
        for group, results in measure(situation, arguments.samples).items():
            true = np.mean([result.true for result in results])
            half = np.mean([result.half for result in results]) / true
            error = np.mean([abs(result.estimate.true - result.true) for result in results]) / true
            more = np.mean([result.estimate.minutes_to_precision for result in results])
            held = np.mean([result.holds for result in results])
            print(
                f"| {name}: {group} | {situation.checked} of {situation.minutes} | {true:.0f} | "
                f"{held:.1%} | {half:.1%} | {error:.1%} | {more:.0f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
