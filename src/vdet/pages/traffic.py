"""What the page of a video shows of its traffic: flows, counts by interval, and speeds."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from vdet.boxes import Image
from vdet.draw.boxes import color_of
from vdet.pages.charts import hex_color
from vdet.traffic.counts import Counts, Event, vehicle_trips
from vdet.traffic.paths import draw_flows
from vdet.traffic.records import VehicleRecord
from vdet.traffic.speeds import KMH

Table = tuple[Sequence[str], Sequence[Sequence[str]]]
"""Headings and rows."""

_UNKNOWN = "–"


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
    counts: Counts, records: Iterable[VehicleRecord], frame: Image | None
) -> TrafficPart:
    """Return the part of a page; `frame` is drawn over."""
    known = {record.id: record for record in records}
    flows: dict[tuple[str, str], list[tuple[Event, Event]]] = {}
    for first, *others in vehicle_trips(counts):
        way = first.name, others[-1].name if others else _UNKNOWN
        flows.setdefault(way, []).append((first, others[-1] if others else first))
    ordered = sorted(flows.items(), key=lambda flow: -len(flow[1]))
    classes = sorted(
        {first.class_name or "unknown" for each in flows.values() for first, _ in each}
    )
    several = classes if len(classes) > 1 else []
    rows, arrows = [], []
    for number, (way, trips) in enumerate(ordered):
        found = Counter(first.class_name or "unknown" for first, _ in trips)
        speeds = [speed for trip in trips if (speed := _mean_speed(known, *trip)) is not None]
        shown = f"{median(speeds):.0f}" if speeds else _UNKNOWN
        rows.append((*way, *(str(found[name]) for name in several), str(len(trips)), shown))
        paths = sorted((known[last.id].path for _, last in trips if last.id in known), key=len)
        if paths:
            arrows.append((paths[len(paths) // 2], len(trips), color_of(number)))
    if frame is not None:
        frame = frame.copy()
        draw_flows(frame, arrows)
    headings = ("from", "to", *several, "vehicles", "mean km/h")
    if all(row[-1] == _UNKNOWN for row in rows):
        headings, rows = headings[:-1], [row[:-1] for row in rows]
    colors = [hex_color(color_of(number)) for number, _ in enumerate(rows)]
    return TrafficPart((headings, rows), colors, frame, _speeds(counts))


def _mean_speed(records: Mapping[int, VehicleRecord], first: Event, last: Event) -> float | None:
    """Return the mean speed of a vehicle from one event to another, km/h; None if not known."""
    record = records.get(last.id)
    if first.id != last.id or record is None or record.speeds is None:
        return None
    found = record.speeds.between(first.time, last.time)
    return found and KMH * found[1]


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
