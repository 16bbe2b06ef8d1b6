"""The sink `counts`: which vehicles cross lines, and enter, leave and stay in zones.

`.csv` has a line for each event: `time`, `frame`, `name`, `direction`, `id`, `class`, `score`,
`stitched`, `seconds` (see `Event`). `.json` has the events, and the totals, the counts by minute
and the stays in zones that follow from them.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np

from vdet.draw.counts import DrawnLine, DrawnZone, draw_counts
from vdet.draw.paint import Surface
from vdet.errors import ConfigError, OutputError
from vdet.lanes.road import Road
from vdet.polygons import Point
from vdet.run.result import FrameResult
from vdet.run.sinks.protocol import BatchTotal, SinkContext, SinkKind
from vdet.traffic.count_files import SUFFIXES, join_counts, write_counts
from vdet.traffic.counter import VehicleCounter
from vdet.traffic.layout import Layout, Line, lay_out
from vdet.traffic.totals import Counts


class CountsSink:
    """Counts through the video, and writes the file at its end."""

    def __init__(self, path: Path, context: SinkContext) -> None:
        self._path = path
        self._files = context.files
        if not context.settings.counts:
            raise OutputError(f"{path}: there is nothing to count at; give lines or zones")
        self._layout = layout_of(context)
        self._counter = VehicleCounter(self._layout)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: Any, *_: object) -> None:
        if kind is None:
            zones = [zone.name for zone in self._layout.zones]
            counts = Counts.of(self._counter.finish(), self._layout.keys, zones)
            write_counts(self._files.stage(self._path), counts)

    def write(self, result: FrameResult) -> None:
        """Count in the next frame."""
        self._counter.update(result.frame_tracks)


COUNTS = SinkKind(
    CountsSink, SUFFIXES, "counts", takes="videos", total=BatchTotal("all", join_counts)
)


def layout_of(context: SinkContext) -> Layout:
    """Place the lines and zones of the settings in the frames of the video.

    Raises
    ------
    OutputError
        They are given for frames of another aspect ratio.
    """
    assert context.video is not None  # `takes` says so
    video = context.video
    try:
        return lay_out(context.settings.counts, video.width, video.height)
    except ConfigError as error:
        raise OutputError(f"{video.path}: counts.{error}") from error


class CountsPicture:
    """Draws the running counts of a video."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._counter = VehicleCounter(layout)

    def draw(self, surface: Surface, result: FrameResult) -> None:
        """Count in the next frame, and draw lines, zones and counts into its picture.

        In an undistorted picture they lie on the same places of the road.
        """
        self._counter.update(result.frame_tracks)
        lines = [self._line(line, result.road) for line in self._layout.lines]
        zones = [
            DrawnZone(
                zone.name,
                tuple(_placed(zone.outline.corners, result.road)),
                self._counter.present(zone),
            )
            for zone in self._layout.zones
        ]
        draw_counts(surface, lines, zones)

    def _line(self, line: Line, road: Road | None) -> DrawnLine:
        start, end = _placed((line.start, line.end), road)
        left, right = ((way, self._counter.count(line.name, way)) for way in line.directions)
        return DrawnLine(line.name, start, end, left, right)


def _placed(points: Sequence[Point], road: Road | None) -> list[Point]:
    """Return where points of the frame lie in the picture that is drawn into."""
    if road is None:
        return list(points)
    return [(x, y) for x, y in road.place_points(np.array(points, np.float64)).tolist()]
