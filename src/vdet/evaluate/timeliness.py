"""How soon vehicles are found, and how often something is followed that is none."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vdet.evaluate.comparison import Comparison, counts
from vdet.evaluate.matching import MatchedFrame


@dataclass(frozen=True, slots=True)
class FirstDetection:
    """When a vehicle was first found.

    `vehicle` is its id in the truth, `appears` the first frame in which it counts, `found` the
    first in which it is matched (both from 1), or None where it never is.
    """

    vehicle: int
    appears: int
    found: int | None

    @property
    def delay(self) -> int | None:
        """Frames until it was found: 0 where at once, None where never."""
        return None if self.found is None else self.found - self.appears


def first_detections(
    comparison: Comparison, matched: Sequence[MatchedFrame]
) -> tuple[FirstDetection, ...]:
    """Return one for every vehicle, in order of index; `matched` is `match(comparison)`."""
    appears: dict[int, int] = {}
    found: dict[int, int] = {}
    for pairs in matched:
        for vehicle in pairs.frame.vehicles.tolist():
            appears.setdefault(vehicle, pairs.frame.number)
        for vehicle in pairs.vehicles.tolist():
            found.setdefault(vehicle, pairs.frame.number)
    return tuple(
        FirstDetection(id_, appears[vehicle], found.get(vehicle))
        for vehicle, id_ in enumerate(comparison.vehicle_ids.tolist())
    )


def false_tracks(comparison: Comparison, matched: Sequence[MatchedFrame]) -> int:
    """Return the number of tracks of which more than half of the boxes match nothing.

    Boxes dropped for an ignore region do not count either way, so a track all of whose boxes are
    dropped is not false.
    """
    right = counts((pairs.tracks for pairs in matched), len(comparison.track_ids))
    return int(np.sum(2 * right < comparison.track_lengths()))
