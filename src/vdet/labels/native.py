"""The formats of vdet itself, JSON lines and CSV; frames and pixels count from 0.

JSON lines have a record for each frame, even without a box. CSV has a row for each box.
"""

import csv
import io
import json
from collections.abc import Iterator, Sequence
from datetime import datetime, timedelta
from itertools import islice
from pathlib import Path
from typing import Annotated, Any, NotRequired

from pydantic import FailFast, Field, TypeAdapter, ValidationError
from typing_extensions import TypedDict

from vdet.config.camera import moment
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

CLOCK = "clock"
"""Name of the fact and the column with the clock time of a frame, ISO 8601."""

_NEEDED = ("frame", "time", "id", "x", "y", "width", "height")
_OPTIONAL = ("score", "state", "class", "foot_x", "foot_y", "distance", "lane", CLOCK)
"""Columns of CSV."""

_BLOCK = 300
"""Number of rows of CSV to check at once; they fit into the cache."""

_Score = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]
_Lane = Annotated[int, Field(ge=-LIMIT, le=LIMIT)]

_Box = TypedDict(
    "_Box",
    {
        "id": Index,
        "x": Number,
        "y": Number,
        "width": Number,
        "height": Number,
        "score": NotRequired[_Score | None],
        "state": NotRequired[State | None],
        "class": NotRequired[str | None],
        "foot": NotRequired[tuple[Number, Number] | None],
        "distance": NotRequired[Number | None],
        "lane": NotRequired[_Lane | None],
    },
)
"""A box of a record, in pixels; unknown keys are ignored."""


class _Record(TypedDict):
    """A line of JSON."""

    frame: Index
    time: float
    tracks: Annotated[list[_Box], FailFast()]
    clock: NotRequired[str]


_Table = TypedDict(
    "_Table",
    {
        "frame": list[Index],
        "time": list[float],
        "id": list[Index],
        "x": list[Number],
        "y": list[Number],
        "width": list[Number],
        "height": list[Number],
        "score": list[_Score | None],
        "state": list[State | None],
        "class": list[str | None],
        "foot_x": list[Number | None],
        "foot_y": list[Number | None],
        "distance": list[Number | None],
        "lane": list[_Lane | None],
        "clock": list[str | None],
    },
)
"""Consecutive rows of CSV, by column; None for an empty cell, and in a missing column."""

_RECORD = TypeAdapter(_Record)
_TABLE = TypeAdapter(_Table)


def track_record(track: Track) -> dict[str, Any]:
    """Return a track as values for JSON; boxes are rounded to whole pixels."""
    x, y, width, height = track.box.xywh
    return {
        "id": track.id,
        "x": x,
        "y": y,
        "width": width,
        "height": height,
        "score": round(track.score, 4),
        "state": track.state,
        "class": track.class_name,
        "foot": list(track.written_foot),
        "distance": _written_distance(track),
        "lane": track.lane,
    }


def _written_distance(track: Track) -> float | None:
    return None if track.distance is None else round(track.distance, 2)


def _json_lines(frame: FrameTracks) -> Iterator[str]:
    """Yield a record: `frame`, `time`, `tracks`, and the facts about the frame."""
    tracks = [track_record(track) for track in frame.tracks]
    record = {"frame": frame.index, "time": round(frame.time, 6), "tracks": tracks}
    yield json.dumps({**record, **frame.facts}) + "\n"


def _csv_lines(frame: FrameTracks) -> Iterator[str]:
    """Yield a row for each box; unknown values are empty."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    for track in frame.tracks:
        x, y, width, height = track.box.xywh
        foot_x, foot_y = track.written_foot
        rows.writerow(
            [
                *(frame.index, f"{frame.time:.6f}", track.id, x, y, width, height),
                *(f"{track.score:.4f}", track.state, track.class_name, foot_x, foot_y),
                *(_written_distance(track), track.lane, frame.facts.get(CLOCK)),
            ]
        )
    yield text.getvalue()


def read_json_lines(path: Path, data: bytes) -> SavedTracks:
    """Read a record for every frame; unknown keys are ignored.

    Raises
    ------
    TruthError
        The file is empty, a line is not such a record, frames do not increase, or a time is wrong.
    """
    times: Times = {}
    labels = limited(path, _json_labels(path, data, times))
    if not times:
        raise TruthError(f"{path}: is empty; it should have a record for every frame")
    seconds = checked_times(path, times)
    line, first = next(numbered_lines(path, data))
    record = _RECORD.validate_json(first)
    begin = _begin(path, line, record.get("clock"), record["time"])
    return SavedTracks(labels, tuple(seconds), seconds, begin=begin)


def _json_labels(path: Path, data: bytes, times: Times) -> Iterator[Label]:
    """Yield the boxes of every record, and put the time of its frame into `times`."""
    last = -1
    for line, content in numbered_lines(path, data):
        try:
            record = _RECORD.validate_json(content)
        except ValidationError as error:
            raise line_error(path, line, first_mistake(error)) from error
        frame = record["frame"]
        if frame <= last:
            raise line_error(path, line, f"frame {frame} comes after frame {last}")
        last = frame
        times[frame] = line, record["time"]
        for box in record["tracks"]:
            score = box.get("score")
            yield Label(
                position=line,
                box=from_size(box["x"], box["y"], box["width"], box["height"]),
                name=box.get("class"),
                frame=frame + 1,
                id=box["id"],
                score=1.0 if score is None else score,
                state=box.get("state") or "detected",
                foot=box.get("foot"),
                distance=box.get("distance"),
                lane=box.get("lane"),
            )


def read_csv(path: Path, data: bytes) -> SavedTracks:
    """Read a table that has at least the columns frame, time, id, x, y, width and height.

    Unknown columns are ignored. An empty cell counts as missing.

    Raises
    ------
    TruthError
        A column is missing or appears twice, a row has a wrong number of cells, a cell has a wrong
        type, or a time is wrong.
    """
    times: Times = {}
    labels = limited(path, _csv_labels(path, data, times))
    seconds = checked_times(path, times)
    begin = None
    for lines, table in _csv_tables(path, data):
        begin = _begin(path, lines[0], table["clock"][0], table["time"][0])
        break
    return SavedTracks(labels, times=seconds, begin=begin)


def _csv_labels(path: Path, data: bytes, times: Times) -> Iterator[Label]:
    """Yield the box of every row, and put the time of its frame into `times`."""
    for lines, table in _csv_tables(path, data):
        times.update(zip(table["frame"], zip(lines, table["time"], strict=True), strict=True))
        boxes = map(from_size, table["x"], table["y"], table["width"], table["height"])
        for row, box in enumerate(boxes):
            score, foot_x, foot_y = table["score"][row], table["foot_x"][row], table["foot_y"][row]
            yield Label(
                position=lines[row],
                box=box,
                name=table["class"][row],
                frame=table["frame"][row] + 1,
                id=table["id"][row],
                score=1.0 if score is None else score,
                state=table["state"][row] or "detected",
                foot=None if foot_x is None or foot_y is None else (foot_x, foot_y),
                distance=table["distance"][row],
                lane=table["lane"][row],
            )


def _csv_tables(path: Path, data: bytes) -> Iterator[tuple[Sequence[int], _Table]]:
    """Yield some rows at a time: the numbers of their lines, and their values.

    Raises `TruthError` if the header or a row is wrong.
    """
    numbered = numbered_lines(path, data)
    header = _cells(path, *next(numbered, (1, "")))
    if any(header.count(name) != 1 for name in _NEEDED):
        names = ", ".join(_NEEDED)
        raise line_error(path, 1, f"the header must name each of these columns once: {names}")
    while block := list(islice(numbered, _BLOCK)):
        lines, rows = [], []
        for line, content in block:
            lines.append(line)
            rows.append(_cells(path, line, content))
            if len(rows[-1]) != len(header):
                message = f"this line has {len(rows[-1])} cells, but the header has {len(header)}"
                raise line_error(path, line, message)
        columns = dict.fromkeys(_OPTIONAL, [""] * len(lines))
        columns |= dict(zip(header, map(list, zip(*rows, strict=True)), strict=True))
        try:
            yield (
                lines,
                _TABLE.validate_python(
                    {name: [cell or None for cell in cells] for name, cells in columns.items()}
                ),
            )
        except ValidationError as error:
            mistake = min(error.errors(), key=lambda mistake: mistake["loc"][1])
            column, row = mistake["loc"][:2]
            raise line_error(path, lines[int(row)], f"{column}: {mistake['msg']}") from error


def _cells(path: Path, line: int, content: str) -> list[str]:
    if '"' not in content and ", " not in content:
        return content.split(",")
    try:
        return next(csv.reader([content], strict=True, skipinitialspace=True), [])
    except csv.Error as error:
        raise line_error(path, line, str(error)) from error


def _begin(path: Path, line: int, clock: str | None, time: float) -> datetime | None:
    """Return the clock time at time 0 from the clock and the time of the first line."""
    try:
        return moment(clock) - timedelta(seconds=time) if clock else None
    except (ValueError, OverflowError) as error:
        raise line_error(path, line, f"clock: {error}") from error


JSON_LINES = Format("JSON lines", ".jsonl", read_json_lines, _json_lines)
CSV = Format("CSV", ".csv", read_csv, _csv_lines, ",".join((*_NEEDED, *_OPTIONAL)) + "\n")
