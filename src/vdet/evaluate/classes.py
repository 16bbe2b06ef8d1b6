"""Which classes the vehicles that are found are given: in pictures by box, in video by track."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

from vdet.detect.classes import OUR_NAMES
from vdet.evaluate.comparison import UNKNOWN, Comparison
from vdet.evaluate.scores import ratio


@dataclass(frozen=True, slots=True)
class ClassResult:
    """How well the vehicles of one class are found and named.

    Attributes
    ----------
    vehicles, found, right
        All of them; those that are found; those that are found and named as this class.
    precision, recall, f1
        Of tracks that name the class; those that find a vehicle of unknown kind are left out.
    named
        The number of vehicles that are found, by the class of their tracks, the most frequent
        first.
    """

    name: str
    vehicles: int
    found: int
    right: int
    precision: float
    recall: float
    f1: float
    named: dict[str, int]


def class_results(comparison: Comparison) -> tuple[ClassResult, ...]:
    """Return a result for each class that has vehicles; none if no track has a class.

    A vehicle has the class of the track that finds it in most frames. A track with more than half
    of its boxes unmatched is a false alarm. A picture is a video of one frame.
    """
    if not set(comparison.track_names) - {UNKNOWN}:
        return ()
    pairs = Counter(_pairs(comparison))
    known = set(comparison.vehicle_names) - {UNKNOWN}
    ordered = [name for name in OUR_NAMES if name in known] + sorted(known - set(OUR_NAMES))
    return tuple(_result(name, pairs) for name in ordered)


_Pair = tuple[str | None, str | None]
"""The classes of a vehicle and of its track. None: missed, or a false alarm."""


def _pairs(comparison: Comparison) -> Iterator[_Pair]:
    together = Counter[tuple[int, int]]()
    for frame in comparison.frames:
        together.update(zip(frame.found.tolist(), frame.found_by.tolist(), strict=True))
    names: dict[int, str] = {}
    for (vehicle, track), _ in together.most_common():
        names.setdefault(vehicle, comparison.track_names[track])
    for vehicle, name in enumerate(comparison.vehicle_names):
        yield name, names.get(vehicle)
    for track in comparison.false_tracks().tolist():
        yield None, comparison.track_names[track]


def _result(name: str, pairs: Counter[_Pair]) -> ClassResult:
    named = Counter({found: count for (true, found), count in pairs.items() if true == name})
    vehicles, right = named.total(), named[name]
    shown = sum(pairs[true, found] for true, found in pairs if found == name and true != UNKNOWN)
    ratios = ratio(right, shown), ratio(right, vehicles), ratio(2 * right, shown + vehicles)
    given = {found: count for found, count in named.most_common() if found}
    return ClassResult(name, vehicles, sum(given.values()), right, *ratios, given)
