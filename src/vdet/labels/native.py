"""The formats of vdet itself, JSON lines and CSV; frames and pixels count from 0.

JSON lines have a record for each frame, even without a box. CSV has a row for each box.
"""

import csv
import io
import json
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from itertools import islice
from pathlib import Path
from typing import Annotated, Any, NotRequired

from pydantic import FailFast, Field, TypeAdapter, ValidationError
from typing_extensions import TypedDict

from vdet.config.camera import parse_date_time
from vdet.errors import TruthError
from vdet.labels.formats import VIDEO, Format
from vdet.labels.label import (
    Label,
    SavedFinding,
    SavedTracks,
    SourceVideo,
    from_size,
    line_error,
)
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

_COLUMNS = (
    *("frame", "time", "id", "x", "y", "width", "height"),
    *("score", "state", "class", "foot_x", "foot_y", "distance", "lane", CLOCK),
)
_NEEDED = _COLUMNS[:7]

_BLOCK = 300
"""Number of boxes to check at once; they fit into the cache."""

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
        "score": list[Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] | None],
        "state": list[State | None],
        "class": list[str | None],
        "foot": list[tuple[Number, Number] | None],
        "distance": list[Number | None],
        "lane": list[Annotated[int, Field(ge=-LIMIT, le=LIMIT)] | None],
    },
)
"""Boxes in pixels, by column; the time is in seconds."""

_TABLE = TypeAdapter(_Table)
_OF_BOX = tuple(_Table.__annotations__)[2:]

_Rows = tuple[Sequence[int], Mapping[str, Sequence[Any]]]
"""The lines of some boxes, and their columns as they are in the file."""


class _Record(TypedDict):
    """A line of JSON."""

    frame: Index
    time: float
    tracks: Annotated[list[dict[str, Any]], FailFast()]
    clock: NotRequired[str]
    video: NotRequired[SourceVideo]  # of the first frame
    findings: NotRequired[tuple[SavedFinding, ...]]  # of the last frame


_RECORD = TypeAdapter(_Record)


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
    video = {VIDEO: frame.facts[VIDEO]} if VIDEO in frame.facts else {}  # at the start of the file
    yield json.dumps({**video, **record, **frame.facts}) + "\n"


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
    labels = tuple(_labels(path, _json_rows(path, data, times), times))
    if not times:
        raise TruthError(f"{path}: is empty; it should have a record for every frame")
    seconds = checked_times(path, times)
    line, first = next(numbered_lines(path, data))
    record = _RECORD.validate_json(first)
    begin = _begin(path, line, record.get("clock"), record["time"])
    saved = SavedTracks(labels, tuple(seconds), seconds, begin=begin)
    if (video := record.get("video")) is None:
        return saved
    last = _RECORD.validate_json(data.rstrip().rpartition(b"\n")[2])
    return saved.of_video(replace(video, findings=last.get("findings", ())))


def _json_rows(path: Path, data: bytes, times: Times) -> Iterator[_Rows]:
    """Yield the boxes of every record, and put the time of its frame into `times`."""
    last = -1
    lines: list[int] = []
    columns: dict[str, list[Any]] = defaultdict(list)
    for line, content in numbered_lines(path, data):
        try:
            record = _RECORD.validate_json(content)
        except ValidationError as error:
            raise line_error(path, line, first_mistake(error)) from error
        frame, time, boxes = record["frame"], record["time"], record["tracks"]
        if frame <= last:
            raise line_error(path, line, f"frame {frame} comes after frame {last}")
        last = frame
        times[frame] = line, time
        lines += [line] * len(boxes)
        columns["frame"] += [frame] * len(boxes)
        columns["time"] += [time] * len(boxes)
        for name in _OF_BOX:
            columns[name] += [box.get(name) for box in boxes]
        if len(lines) >= _BLOCK:
            yield lines, columns
            lines, columns = [], defaultdict(list)
    if lines:
        yield lines, columns


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
    labels = tuple(_labels(path, _csv_rows(path, data), times))
    seconds = checked_times(path, times)
    for lines, columns in _csv_rows(path, data):
        begin = _begin(path, lines[0], columns[CLOCK][0], float(columns["time"][0]))
        return SavedTracks(labels, times=seconds, begin=begin)
    return SavedTracks(labels)


def _csv_rows(path: Path, data: bytes) -> Iterator[_Rows]:
    """Yield some rows at a time; empty cells, and those of missing columns, are None."""
    numbered = numbered_lines(path, data)
    header = _cells(path, *next(numbered, (1, "")))
    if any(header.count(name) != 1 for name in _NEEDED):
        names = ", ".join(_NEEDED)
        raise line_error(path, 1, f"the header must name each of these columns once: {names}")
    while block := list(islice(numbered, _BLOCK)):
        rows = []
        for line, content in block:
            cells = _cells(path, line, content)
            if len(cells) != len(header):
                message = f"this line has {len(cells)} cells, but the header has {len(header)}"
                raise line_error(path, line, message)
            rows.append(cells)
        columns: dict[str, list[Any]] = dict.fromkeys(_COLUMNS, [None] * len(rows))
        for name, column in zip(header, zip(*rows, strict=True), strict=True):
            columns[name] = [cell or None for cell in column]
        feet = zip(columns["foot_x"], columns["foot_y"], strict=True)
        columns["foot"] = [None if None in foot else foot for foot in feet]
        yield [line for line, _ in block], columns


def _cells(path: Path, line: int, content: str) -> list[str]:
    if '"' not in content and ", " not in content:
        return content.split(",")
    try:
        return next(csv.reader([content], strict=True, skipinitialspace=True), [])
    except csv.Error as error:
        raise line_error(path, line, str(error)) from error


def _labels(path: Path, blocks: Iterable[_Rows], times: Times) -> Iterator[Label]:
    """Yield the label of each row, and put the time of its frame into `times`."""
    for lines, columns in blocks:
        try:
            table = _TABLE.validate_python(columns)
        except ValidationError as error:
            mistake = min(error.errors(), key=lambda mistake: mistake["loc"][1])
            column, row = mistake["loc"][:2]
            raise line_error(path, lines[int(row)], f"{column}: {mistake['msg']}") from error
        times.update(zip(table["frame"], zip(lines, table["time"], strict=True), strict=True))
        boxes = map(from_size, table["x"], table["y"], table["width"], table["height"])
        optional = (table[name] for name in ("score", "state", "class", "foot", "distance", "lane"))
        rows = zip(lines, table["frame"], table["id"], boxes, *optional, strict=True)
        for line, frame, id_, box, score, state, name, foot, distance, lane in rows:
            yield Label(
                position=line,
                box=box,
                name=name,
                frame=frame + 1,
                id=id_,
                score=1.0 if score is None else score,
                state=state or "detected",
                foot=foot,
                distance=distance,
                lane=lane,
            )


def _begin(path: Path, line: int, clock: str | None, time: float) -> datetime | None:
    """Return the clock time at time 0 from the clock and the time of the first line."""
    try:
        return parse_date_time(clock) - timedelta(seconds=time) if clock else None
    except (ValueError, OverflowError) as error:
        raise line_error(path, line, f"clock: {error}") from error


JSON_LINES = Format("JSON lines", ".jsonl", read_json_lines, _json_lines)
CSV = Format("CSV", ".csv", read_csv, _csv_lines, ",".join(_COLUMNS) + "\n")
