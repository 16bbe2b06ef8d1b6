"""Files of counts and of flows, of one video and of many.

The ending of a name chooses the table; `.json` has all tables. Of several videos there is one table
by interval; events have the name of their video.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple
from pathlib import Path
from typing import Any

from vdet.traffic.counts import (
    CountRow,
    Counts,
    Event,
    FlowRow,
    count_table,
    flow_table,
    zone_table,
)
from vdet.traffic.tables import VIDEO, is_json, join_tables, plain_moment, write_content

_EVENTS = (
    *("time", "clock", "frame", "name", "direction"),
    *("id", "vehicle", "class", "score", "seconds"),
    *("speed", "speed_sd", "mean_speed"),
)
_TOTALS = ("start", "end", "name", "direction", "class", "count")
_ZONES = (
    *("start", "end", "name", "entered", "left"),
    *("mean", "most", "mean_stay", "longest_stay"),
)
_FLOWS = ("start", "end", "from", "to", "class", "count")

NOWHERE = "(none)"
"""In tables, where a flow leads that ends at its first line or zone."""

ALL = "all"
"""In wide tables, the column of a sum."""

COUNT_SUFFIXES = (".csv", ".json", ".totals.csv", ".zones.csv", ".wide.csv")
FLOW_SUFFIXES = (".csv", ".json", ".matrix.csv", ".wide.csv")

Videos = Mapping[str, Counts]
"""The counts of videos by their names."""


def write_counts(path: Path, videos: Videos, interval: int | None = None) -> None:
    """Write the events, or what the ending of `path` says: totals (also wide), zones, all as JSON.

    Parameters
    ----------
    interval
        That of totals and zones, seconds; None for the whole.

    Raises
    ------
    ConfigError
        As `count_table`.
    """
    write_content(path, counts_content(path, videos, interval))


def counts_content(path: Path, videos: Videos, interval: int | None = None) -> Any:
    """Return what `write_counts` writes, as `write_content` takes it."""
    every = list(videos.values())
    if is_json(path):
        tables = {
            "totals": _items(_TOTALS, count_table(every, interval)),
            "zones": _items(_ZONES, zone_table(every, interval)),
        }
        return _json(videos, interval, tables, events=True)
    if _is_table(path, ".totals"):
        return [_TOTALS, *map(_cells, count_table(every, interval))]
    if _is_table(path, ".wide"):
        return wide_table(count_table(every, interval), ": ")
    if _is_table(path, ".zones"):
        return [_ZONES, *map(_cells, zone_table(every, interval))]
    alone = len(videos) == 1  # then the name is left out
    rows = [(name, *_event(video, e)) for name, video in videos.items() for e in video.events]
    return [(VIDEO, *_EVENTS)[alone:], *(row[alone:] for row in rows)]


def write_flows(path: Path, videos: Videos, interval: int | None = None) -> None:
    """Write the flows, or what the ending of `path` says: wide, their matrix, or all as JSON.

    Parameters and errors as of `write_counts`.
    """
    write_content(path, flows_content(path, videos, interval))


def flows_content(path: Path, videos: Videos, interval: int | None = None) -> Any:
    """Return what `write_flows` writes, as `write_content` takes it."""
    every = list(videos.values())
    rows = flow_table(every, interval)
    if is_json(path):
        tables = {"flows": _items(_FLOWS, rows), "matrix": flow_matrix(every, rows)}
        return _json(videos, interval, tables, events=False)
    if _is_table(path, ".wide"):
        return wide_table(rows, " to ")
    if _is_table(path, ".matrix"):
        matrix = flow_matrix(every, rows)
        return [_matrix_columns(every), *((name, *row.values()) for name, row in matrix.items())]
    return [_FLOWS, *map(_cells, rows)]


def wide_table(rows: Sequence[CountRow | FlowRow], between: str) -> list[Sequence[Any]]:
    """Return a table with a row for each interval, and a column for each way and class, and sums.

    `between` is the text between the two names of a way.
    """
    found: Counter[tuple[Any, ...]] = Counter()
    cells = [_cells(row) for row in rows]
    for start, end, *way, name, count in cells:
        for interval in ((start, end), (ALL, "")):
            for column in ((*way, name), (*way, ALL), (ALL,)):
                found[*interval, *column] += count
    intervals = dict.fromkeys(tuple(row[:2]) for row in cells)
    classes = dict.fromkeys(row[4] for row in cells)
    ways = dict.fromkeys(tuple(row[2:4]) for row in cells)
    columns = [*((*way, name) for way in ways for name in (*classes, ALL)), (ALL,)]
    heading = (*(f"{between.join(way)}, {name}" for *way, name in columns[:-1]), ALL)
    body = (
        (*interval, *(found[*interval, *column] for column in columns))
        for interval in (*intervals, (ALL, ""))
    )
    return [("start", "end", *heading), *body]


def flow_matrix(videos: Sequence[Counts], rows: Iterable[FlowRow]) -> dict[str, dict[str, int]]:
    """Return the number of vehicles over all intervals and classes, by origin and destination."""
    found: Counter[tuple[str, str]] = Counter()
    for row in rows:
        found[row.origin, row.destination or NOWHERE] += row.count
    _, *ends = _matrix_columns(videos)
    return {origin: {end: found[origin, end] for end in ends} for origin in ends[:-1]}


def _matrix_columns(videos: Iterable[Counts]) -> tuple[str, ...]:
    return ("from", *dict.fromkeys(name for video in videos for name, _ in video.ways), NOWHERE)


def join_counts(videos: Mapping[str, Any], path: Path) -> None:
    """Write one file over the videos of a batch, from the content for each.

    A row gets the name of its video; JSON has the totals over all videos, and the JSON of each.
    """
    _join(videos, path, "totals", _TOTALS)


def join_flows(videos: Mapping[str, Any], path: Path) -> None:
    """Write the flows of the videos of a batch into one file, as `join_counts` does."""
    _join(videos, path, "flows", _FLOWS)


def _join(videos: Mapping[str, Any], path: Path, table: str, columns: Sequence[str]) -> None:
    if is_json(path):
        content: Any = _joined(table, columns[2:-1], videos)
    else:
        content = join_tables(videos, missing=0)
    write_content(path, content)


def _joined(table: str, keys: Sequence[str], videos: Mapping[str, Any]) -> dict[str, Any]:
    """Return the JSON of many videos, with the sum of the rows of a table over all of them."""
    counts: Counter[tuple[str, ...]] = Counter()
    for row in (row for video in videos.values() for row in video[table]):
        counts[tuple(row[key] for key in keys)] += row["count"]
    rows = [dict(zip(keys, key, strict=True)) | {"count": n} for key, n in counts.items()]
    return {table: rows, "videos": videos}


def _json(
    videos: Videos, interval: int | None, tables: Mapping[str, Any], *, events: bool
) -> dict[str, Any]:
    facts: dict[str, Any] = {}
    for name, video in videos.items():
        begin = plain_moment(video.clock and video.clock.at(video.spans[0][0]))
        facts[name] = {"begin": begin, "warnings": list(video.warnings)}
        if events:
            facts[name]["events"] = [
                dict(zip(_EVENTS, _event(video, event), strict=True)) for event in video.events
            ]
    alone = facts.popitem()[1] if len(facts) == 1 else {"videos": facts}
    return {"interval": interval, **tables, **alone}


def _is_table(path: Path, kind: str) -> bool:
    return path.name.lower().endswith(f"{kind}.csv")


def _event(video: Counts, event: Event) -> list[Any]:
    time, *others = astuple(event)
    return [time, plain_moment(video.clock and video.clock.at(time)), *others]


def _items(columns: Sequence[str], rows: Iterable[Any]) -> list[dict[str, Any]]:
    return [dict(zip(columns, map(plain_moment, astuple(row)), strict=True)) for row in rows]


def _cells(row: Any) -> list[Any]:
    cells = list(map(plain_moment, astuple(row)))
    return [NOWHERE if n == 3 and cell is None else cell for n, cell in enumerate(cells)]
