"""The formats of vdet itself, JSON lines and CSV; frames and pixels count from 0.

JSON lines have a record for each frame, even without a box. CSV has a row for each box.
"""

import csv
import io
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime, timedelta
from itertools import islice
from operator import itemgetter
from pathlib import Path
from typing import Annotated, Any, NotRequired

from pydantic import FailFast, Field, TypeAdapter, ValidationError
from typing_extensions import TypedDict

from vdet.config.camera import parse_date_time
from vdet.errors import TruthError
from vdet.labels.formats import Format
from vdet.labels.label import Label, SavedTracks, from_size, limited, line_error
from vdet.labels.parsing import (
    LIMIT,
    Index,
    Number,
    Times,
    checked_times,
    first_mistake,
    numbered_lines,
)
from vdet.track.track import FrameTracks, State, Track

_NEEDED = ("frame", "time", "id", "x", "y", "width", "height")
_COLUMNS = (*_NEEDED, "score", "state", "class", "foot_x", "foot_y", "distance", "lane")
_FOOT = slice(10, 12)  # columns

CLOCK = "clock"
"""Name of the fact and the column with the clock time of a frame, ISO 8601."""

_KINDS = {
    "frame": Index,
    "time": float,
    "id": Index,
    **dict.fromkeys(("x", "y", "width", "height"), Number),
    "score": Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] | None,
    "state": State | None,
    "class": str | None,
    "foot": tuple[Number, Number] | None,
    "distance": Number | None,
    "lane": Annotated[int, Field(ge=-LIMIT, le=LIMIT)] | None,
}
"""The values of a box, in pixels, after the frame and the time in seconds."""
_OF_TRACK = tuple(_KINDS)[2:]
_Columns: Any = tuple[(*(list[kind] for kind in _KINDS.values()),)]  # type: ignore[misc,valid-type]
_TABLE: TypeAdapter[Any] = TypeAdapter(_Columns)
_BLOCK = 300
"""Number of rows to check at once; they fit into the cache."""

_Row = tuple[int, Sequence[Any]]
"""The line of a box in its file, and its cells."""
_Block = tuple[Sequence[int], Sequence[Sequence[Any]]]
"""The lines of boxes, and their columns in the order of `_KINDS`."""


class _Record(TypedDict):
    frame: Index
    time: float
    tracks: Annotated[list[dict[str, Any]], FailFast()]
    clock: NotRequired[str]


_RECORD = TypeAdapter(_Record)


def _json_lines(frame: FrameTracks) -> Iterator[str]:
    """Yield a record: `frame`, `time`, `tracks`, and the facts about the frame."""
    tracks = [track_record(track) for track in frame.tracks]
    record = {"frame": frame.index, "time": round(frame.time, 6), "tracks": tracks}
    yield json.dumps({**record, **frame.facts}) + "\n"


def track_record(track: Track) -> dict[str, Any]:
    """Return a track as values for JSON; boxes are rounded to whole pixels."""
    return {
        "id": track.id,
        **dict(zip(("x", "y", "width", "height"), track.box.xywh, strict=True)),
        "score": round(track.score, 4),
        "state": track.state,
        "class": track.class_name,
        "foot": list(track.written_foot),
        "distance": None if track.distance is None else round(track.distance, 2),
        "lane": track.lane,
    }


def _csv_lines(frame: FrameTracks) -> Iterator[str]:
    """Yield a row for each box; unknown values are empty."""
    rows, clock = io.StringIO(), frame.facts.get(CLOCK)
    writer = csv.writer(rows, lineterminator="\n")
    for track in frame.tracks:
        known = track_record(track)
        place, score = track.box.xywh, f"{track.score:.4f}"
        cells = (frame.index, f"{frame.time:.6f}", track.id, *place, score, track.state)
        others = (track.class_name, *known["foot"], known["distance"], known["lane"])
        writer.writerow((*cells, *others, clock))
    yield rows.getvalue()


def read_json_lines(path: Path, data: bytes) -> SavedTracks:
    """Read a record for every frame; unknown keys are ignored.

    Raises
    ------
    TruthError
        The file is empty, a line is not such a record, frames do not increase, or a time is wrong.
    """
    found: Times = {}
    labels = limited(path, _labels(path, _blocks(_json_rows(path, data, found)), found))
    times = checked_times(path, found)
    if not times:
        raise TruthError(f"{path}: is empty; it should have a record for every frame")
    line, first = next(numbered_lines(path, data))
    begin = _begin(path, line, _RECORD.validate_json(first))
    return SavedTracks(labels, tuple(times), times, begin=begin)


def read_csv(path: Path, data: bytes) -> SavedTracks:
    """Read a table that has at least the columns frame, time, id, x, y, width and height.

    Unknown columns are ignored. An empty cell counts as missing.

    Raises
    ------
    TruthError
        A column is missing or appears twice, a row has a wrong number of cells, a cell has a wrong
        type, or a time is wrong.
    """
    found: Times = {}
    labels = limited(path, _labels(path, _csv_blocks(path, data), found))
    times = checked_times(path, found)
    (_, head), *rows = islice(numbered_lines(path, data), 2)
    begin = None
    for line, row in rows:
        cells = (_cells(path, line, text) for text in (head, row))
        begin = _begin(path, line, dict(zip(*cells, strict=True)))
    return SavedTracks(labels, times=times, begin=begin)


def _begin(path: Path, line: int, first: Mapping[str, Any]) -> datetime | None:
    """Return the clock time at time 0 from the time and clock of the first line."""
    clock = first.get(CLOCK)
    try:
        return parse_date_time(clock) - timedelta(seconds=float(first["time"])) if clock else None
    except (ValueError, OverflowError) as error:
        raise line_error(path, line, f"clock: {error}") from error


def _labels(path: Path, blocks: Iterable[_Block], times: Times) -> Iterator[Label]:
    """Yield the label of each row, and put the time of its frame into `times`."""
    for lines, columns in blocks:
        try:
            values = _TABLE.validate_python(columns)
        except ValidationError as error:
            first = min(error.errors(), key=lambda mistake: mistake["loc"][1])
            column, row = map(int, first["loc"][:2])
            what = f"{tuple(_KINDS)[column]}: {first['msg']}"
            raise line_error(path, lines[row], what) from error
        frames, seconds, ids, *sides, scores, states, names, feet, distances, lanes = values
        times.update(zip(frames, zip(lines, seconds, strict=True), strict=True))
        numbers, regions = [frame + 1 for frame in frames], [False] * len(lines)
        scores = [1.0 if score is None else score for score in scores]
        states = [state or "detected" for state in states]
        boxes = map(from_size, *sides)
        known = numbers, ids, scores, regions, states, feet, distances, lanes
        yield from map(Label._make, zip(lines, boxes, names, *known, strict=True))


def _blocks(rows: Iterable[_Row]) -> Iterator[_Block]:
    left = iter(rows)
    while block := list(islice(left, _BLOCK)):
        lines, cells = zip(*block, strict=True)
        yield lines, tuple(zip(*cells, strict=True))


def _json_rows(path: Path, data: bytes, times: Times) -> Iterator[_Row]:
    """Yield the boxes of every record, and put the time of its frame into `times`."""
    last = -1
    for line, content in numbered_lines(path, data):
        try:
            record = _RECORD.validate_json(content)
        except ValidationError as error:
            raise line_error(path, line, first_mistake(error)) from error
        if record["frame"] <= last:
            raise line_error(path, line, f"frame {record['frame']} comes after frame {last}")
        last, time = record["frame"], record["time"]
        times[last] = line, time
        for track in record["tracks"]:
            yield line, (last, time, *map(track.get, _OF_TRACK))


def _csv_blocks(path: Path, data: bytes) -> Iterator[_Block]:
    """Yield the rows of a table; an empty cell is None, and so is one of a missing column."""
    lines = numbered_lines(path, data)
    names = _cells(path, *next(lines, (1, "")))
    if any(names.count(name) != 1 for name in _NEEDED):
        needed = ", ".join(_NEEDED)
        raise line_error(path, 1, f"the header must name each of these columns once: {needed}")
    pick = itemgetter(*(names.index(name) if name in names else -1 for name in _COLUMNS))
    for numbers, columns in _blocks(_csv_rows(path, lines, len(names))):
        found = pick((*columns, [""] * len(numbers)))
        known = [[cell or None for cell in cells] if "" in cells else cells for cells in found]
        feet = zip(*known[_FOOT], strict=True)
        known[_FOOT] = [[None if None in foot else foot for foot in feet]]
        yield numbers, known


def _csv_rows(path: Path, lines: Iterable[tuple[int, str]], columns: int) -> Iterator[_Row]:
    for line, content in lines:
        cells = _cells(path, line, content)
        if len(cells) != columns:
            what = f"has {len(cells)} cells, but the header has {columns}"
            raise line_error(path, line, f"this line {what}")
        yield line, cells


def _cells(path: Path, line: int, content: str) -> list[str]:
    if '"' not in content and ", " not in content:
        return content.split(",")
    try:
        return next(csv.reader([content], strict=True, skipinitialspace=True), [])
    except csv.Error as error:
        raise line_error(path, line, str(error)) from error


JSON_LINES = Format("JSON lines", ".jsonl", read_json_lines, _json_lines)
CSV = Format("CSV", ".csv", read_csv, _csv_lines, ",".join((*_COLUMNS, CLOCK)) + "\n")
