"""What the page of a video shows of its traffic: flows, counts by interval, and speeds."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from vdet.boxes import Image
from vdet.detect.classes import UNKNOWN
from vdet.draw.boxes import color_of
from vdet.lanes.ground import Ground
from vdet.pages.charts import hex_color
from vdet.pages.place import draw_marks, flows_of, place_marks
from vdet.traffic.counts import Counts
from vdet.traffic.crossings import Border
from vdet.traffic.records import VehicleRecord

Table = tuple[Sequence[str], Sequence[Sequence[str]]]
"""Headings and rows."""


@dataclass(frozen=True, slots=True)
class TrafficPart:
    """What a page shows of the counts of a video.

    `flows` has a row for each flow, the largest first, with its colour in `colors`, and `picture`
    an arrow for each. `speeds` has a row for each direction in which speeds are known.
    """

    flows: Table
    colors: Sequence[str]
    picture: Image | None
    speeds: Table


def traffic_part(
    counts: Counts,
    records: Iterable[VehicleRecord],
    frame: Image | None,
    borders: Sequence[Border] = (),
    ground: Ground | None = None,
) -> TrafficPart:
    """Return the part of a page; `frame` is drawn over, with its lines and zones."""
    flows = flows_of(counts)
    classes = sorted({first.class_name or UNKNOWN for flow in flows.values() for first, _ in flow})
    several = classes if len(classes) > 1 else []
    rows = []
    for way, trips in flows.items():
        found = Counter(first.class_name or UNKNOWN for first, _ in trips)
        rows.append((*way, *(str(found[name]) for name in several), str(len(trips))))
    if frame is not None:
        frame = frame.copy()
        ways = {record.id: record.path for record in records}
        size = frame.shape[1], frame.shape[0]
        draw_marks(frame, place_marks(size, borders, counts, ways, ground))
    headings = ("from", "to", *several, "vehicles")
    colors = [hex_color(color_of(number)) for number, _ in enumerate(rows)]
    return TrafficPart((headings, rows), colors, frame, _speeds(counts))


def _speeds(counts: Counts) -> Table:
    rows = []
    for way in counts.ways:
        speeds = [
            event.speed
            for event in counts.events
            if (event.name, event.direction) == way and event.speed is not None
        ]
        if speeds:
            numbers = np.quantile(speeds, [0.5, 0.85]).tolist()
            rows.append((*way, str(len(speeds)), *(f"{number:.0f}" for number in numbers)))
    return ("line or zone", "direction", "vehicles", "median km/h", "85 % km/h"), rows
