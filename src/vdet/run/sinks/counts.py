"""The sink `counts`: which vehicles cross lines, and enter, leave and stay in zones.

`.csv` has a line for each event: `time`, `frame`, `name`, `direction`, `id`, `class`, `score`,
`stitched`, `seconds` (see `Event`). `.json` has the events, and the totals, the counts by minute
and the stays in zones that follow from them.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vdet.draw.paint import Surface
from vdet.draw.places import DrawnLine, DrawnZone, draw_counts
from vdet.errors import OutputError
from vdet.lanes.road import Road
from vdet.polygons import Point
from vdet.run.result import FrameResult
from vdet.run.sinks.protocol import BaseSink, BatchTotal, SinkContext, SinkKind
from vdet.traffic.count_files import join_counts, write_counts
from vdet.traffic.counter import VehicleCounter
from vdet.traffic.layout import Line
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

    def drawn(line: Line) -> DrawnLine:
        start, end = _placed((line.start, line.end), road)
        left, right = ((way, counter.count(line.name, way)) for way in line.directions)
        return DrawnLine(line.name, start, end, left, right)

    layout = counter.layout
    zones = [
        DrawnZone(zone.name, tuple(_placed(zone.outline.corners, road)), counter.present(zone))
        for zone in layout.zones
    ]
    draw_counts(surface, [drawn(line) for line in layout.lines], zones)


def _placed(points: Sequence[Point], road: Road | None) -> list[Point]:
    """Return where points of the frame lie in the picture that is drawn into."""
    if road is None:
        return list(points)
    return [(x, y) for x, y in road.place_points(np.array(points, np.float64)).tolist()]
