"""Lines that are not where they should be, as the tracks of a run show."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from statistics import median

from vdet.polygons import distance_to
from vdet.traffic.borders import BorderState, PlacedLine, Sighting
from vdet.traffic.counts import Event

_NEAR = 0.5
"""Distance in heights of its box within which a track that begins or ends is at a line."""
_FEW = 0.05
"""Share of the crossings of a line up to which tracks that go wrong there are no warning."""


def is_missed_at(state: BorderState, ends: Sequence[Sighting]) -> bool:
    """Return whether a track begins or ends at a line that it has not crossed."""
    line = state.border
    if not isinstance(line, PlacedLine) or state.has_crossed:
        return False
    segment = line.start, line.end
    return any(distance_to(segment, each.point) <= _NEAR * each.height for each in ends)


def line_warnings(
    lines: Sequence[PlacedLine],
    events: Sequence[Event],
    missed: Mapping[str, int],
    heights: Mapping[str, Sequence[float]],
) -> Iterator[str]:
    """Yield a sentence for each thing that is wrong with a line.

    Parameters
    ----------
    missed
        How many tracks begin or end at a line and do not cross it: see `is_missed_at`.
    heights
        Of the boxes of vehicles where they cross a line, pixels.
    """
    for line in lines:
        crossings = Counter(each.vehicle for each in events if each.name == line.name)
        few = _FEW * len(crossings)
        again = sum(count > 1 for count in crossings.values())
        if not crossings:
            yield f"{line.name}: no path crosses this line; move it"
        if missed.get(line.name, 0) > few:
            yield (
                f"{line.name}: tracks that begin or end at this line and are not counted: "
                f"{missed[line.name]}; move it to where vehicles are followed longer"
            )
        if again > few:
            yield (
                f"{line.name}: paths that cross this line more than once: {again}; place it across "
                "the way of the vehicles"
            )
        if crossings and line.length < median(heights[line.name]):
            yield f"{line.name}: this line is shorter than a vehicle; make it longer"
