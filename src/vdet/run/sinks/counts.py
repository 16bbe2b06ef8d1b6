"""The sink `counts`: which vehicles cross lines, and enter, leave and stay in zones.

`.csv` has a line for each event: `time`, `frame`, `name`, `direction`, `id`, `class`, `score`,
`stitched`, `seconds` (see `Event`). `.json` has the events, and the totals, the counts by minute
and the stays in zones that follow from them.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vdet.draw.boxes import draw_line, draw_zone
from vdet.draw.paint import Surface
from vdet.errors import OutputError
from vdet.lanes.road import Road
from vdet.polygons import Point
from vdet.run.result import FrameResult
from vdet.run.sinks.protocol import BaseSink, BatchTotal, SinkContext, SinkKind
from vdet.traffic.counter import VehicleCounter
from vdet.traffic.counts import join_counts, write_counts
from vdet.traffic.tables import SUFFIXES


class CountsSink(BaseSink):
    """Writes the counts at the end of the video."""

    def __init__(self, path: Path, context: SinkContext) -> None:
        super().__init__(path, context)
        self._counter: VehicleCounter | None = None
        if not context.settings.counts:
            raise OutputError(f"{path}: there is nothing to count at; give lines or zones")

    def finish(self) -> None:
        """Write the counts."""
        if self._counter:
            write_counts(self.context.files.stage(self.path), self._counter.counts())

    def write(self, result: FrameResult) -> None:
        """Keep the counter: at the end it has the counts of all frames."""
        self._counter = result.counter


COUNTS = SinkKind(
    CountsSink, SUFFIXES, "counts", takes="videos", total=BatchTotal("all", join_counts)
)


def draw_running_counts(surface: Surface, counter: VehicleCounter, road: Road | None) -> None:
    """Draw the lines and zones, and what is counted so far.

    In an undistorted picture they lie on the same places of the road.
    """
    for zone in counter.zones:
        label = f"{zone.name}: {counter.present(zone)}"
        draw_zone(surface, _placed(zone.corners, road), label)
    for line in counter.lines:
        left, right = (
            f"{line.name} {way}: {counter.count(line.name, way)}" for way in line.directions
        )
        start, end = _placed((line.start, line.end), road)
        draw_line(surface, start, end, (left, right))


def _placed(points: Sequence[Point], road: Road | None) -> list[Point]:
    """Return where points of the frame lie in the picture that is drawn into."""
    if road is None:
        return list(points)
    return [(x, y) for x, y in road.undistorter.points(np.array(points, np.float64)).tolist()]
