"""The formats of lines: JSON lines, CSV and MOTChallenge.

JSON lines have a record for each frame, even without a box. CSV and MOTChallenge have a row for
each box. Frames and pixels count from 0, in MOTChallenge from 1.

Source: Milan et al., "MOT16: A Benchmark for Multi-Object Tracking", 2016, tables 3 and 4.
"""

import csv
import io
import logging
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import FailFast, Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from vdet.boxes import Box
from vdet.config.scene import parse_date_time
from vdet.errors import TruthError
from vdet.files import json_line
from vdet.findings import Finding
from vdet.labels.label import (
    LIMIT,
    VIDEO,
    Format,
    Index,
    Number,
    SavedTracks,
    SourceVideo,
    Times,
    checked_times,
    first_mistake,
    line_error,
    numbered_lines,
)
from vdet.track.track import FrameTracks, State, Track

_T = TypeVar("_T")

CLOCK = "clock"
"""Name of the fact and the column with the clock time of a frame, ISO 8601."""

_COLUMNS = (
    *("frame", "time", "id", "x", "y", "width", "height"),
    *("score", "state", "class", "foot_x", "foot_y", "distance", "lane", CLOCK),
)
_NEEDED = _COLUMNS[:7]

_Whole = Annotated[int, Field(ge=-LIMIT, le=LIMIT)]

_log = logging.getLogger("vdet")
_MAX_CLASSES = 100  # more are positions, in the eighth column of results
_TRUTH_COLUMNS, _RESULT_COLUMNS = 9, 10


@dataclass(frozen=True, slots=True, kw_only=True)
class _BoxFields:
    """A box of a record or of a row, pixels."""

    id: Index
    x: Number
    y: Number
    width: Number
    height: Number
    score: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] | None = None
    state: State | None = None
    class_name: str | None = Field(None, alias="class")
    foot: tuple[Number, Number] | None = None
    distance: Number | None = None
    lane: _Whole | None = None

    def track(self, line: int) -> Track:
        """Return the box of a line."""
        return Track(
            self.id,
            Box.sized(self.x, self.y, self.width, self.height),
            1.0 if self.score is None else self.score,
            self.state or "detected",
            self.class_name,
            self.foot,
            self.distance,
            self.lane,
            line,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Row(_BoxFields):
    """A row of CSV; the time is in seconds."""

    frame: Index
    time: float
    clock: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Record:
    """A line of JSON."""

    frame: Index
    time: float
    tracks: Annotated[list[_BoxFields], FailFast()]
    clock: str | None = None
    video: SourceVideo | None = None  # of the first frame
    findings: tuple[Finding, ...] = ()  # of the last frame
    last: bool | None = None  # of the first and the last frame; None in files of vdet 1.1


_ROW, _RECORD = TypeAdapter(_Row), TypeAdapter(_Record)


def _checked(path: Path, line: int, validate: Callable[[Any], _T], values: Any) -> _T:
    """Return the validated values of a line. Raises `TruthError`."""
    try:
        return validate(values)
    except ValidationError as error:
        raise line_error(path, line, first_mistake(error)) from error


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
        "distance": None if track.distance is None else round(track.distance, 2),
        "lane": track.lane,
    }


def _json_lines(frame: FrameTracks) -> Iterator[str]:
    """Yield a record: `frame`, `time`, `tracks`, and the facts about the frame."""
    tracks = [track_record(track) for track in frame.tracks]
    record = {"frame": frame.index, "time": round(frame.time, 6), "tracks": tracks}
    video = {VIDEO: frame.facts[VIDEO]} if VIDEO in frame.facts else {}  # at the start of the file
    yield json_line({**video, **record, **frame.facts})


def _csv_lines(frame: FrameTracks) -> Iterator[str]:
    """Yield a row for each box; unknown values are empty."""
    text = io.StringIO()
    rows = csv.DictWriter(text, _COLUMNS, lineterminator="\n")
    of_frame = {"frame": frame.index, "time": f"{frame.time:.6f}", CLOCK: frame.facts.get(CLOCK)}
    for track in frame.tracks:
        record = track_record(track)
        foot_x, foot_y = record.pop("foot")
        of_box = {"score": f"{track.score:.4f}", "foot_x": foot_x, "foot_y": foot_y}
        rows.writerow({**of_frame, **record, **of_box})
    yield text.getvalue()


def read_json_lines(path: Path, data: bytes, *, is_head: bool = False) -> SavedTracks:
    """Read a record for every frame, or of the first ones; unknown keys are ignored.

    Raises
    ------
    TruthError
        The file is empty or cut off, or has a second video, a line is not such a record, frames do
        not increase, or a time is wrong.
    """
    frames: dict[int, list[Track]] = {}
    times: Times = {}
    first, last, is_whole = None, -1, False
    for line, content in numbered_lines(path, data):
        record = _checked(path, line, _RECORD.validate_json, content)
        if is_whole or (first and record.video):
            raise line_error(path, line, "another video begins; each video needs its own file")
        is_whole = record.last is True
        if record.frame <= last:
            raise line_error(path, line, f"frame {record.frame} comes after frame {last}")
        first, last = first or record, record.frame
        times[last] = line, record.time
        if record.tracks:
            frames[last] = [box.track(line) for box in record.tracks]
    if first is None:
        raise TruthError(f"{path}: is empty; it should have a record for every frame")
    if first.last is False and not (is_whole or is_head):
        raise TruthError(f"{path}: is cut off after frame {last}; copy or write it again")
    seconds, begin = checked_times(path, times), _begin(path, times[first.frame], first.clock)
    saved = SavedTracks(frames, tuple(seconds), seconds, begin=begin)
    video = first.video and replace(first.video, findings=record.findings)
    return saved.of_video(video) if video else saved


def read_csv(path: Path, data: bytes) -> SavedTracks:
    """Read a table that has at least the columns frame, time, id, x, y, width and height.

    Unknown columns are ignored. An empty cell counts as missing.

    Raises
    ------
    TruthError
        A column is missing or appears twice, a row has a wrong number of cells, a cell has a wrong
        type, or a time is wrong.
    """
    frames: dict[int, list[Track]] = {}
    times: Times = {}
    begin = None
    for line, cells in _csv_rows(path, data):
        row = _checked(path, line, _ROW.validate_python, cells)
        times[row.frame] = line, row.time
        if not frames:
            begin = _begin(path, times[row.frame], row.clock)
        frames.setdefault(row.frame, []).append(row.track(line))
    return SavedTracks(frames, times=checked_times(path, times), begin=begin)


def _csv_rows(path: Path, data: bytes) -> Iterator[tuple[int, dict[str, Any]]]:
    """Yield the number and the cells of each row by name; empty ones are None."""
    numbered = numbered_lines(path, data)
    header = _cells(path, *next(numbered, (1, "")))
    if any(header.count(name) != 1 for name in _NEEDED):
        names = ", ".join(_NEEDED)
        raise line_error(path, 1, f"the header must name each of these columns once: {names}")
    for line, content in numbered:
        cells = _cells(path, line, content)
        if len(cells) != len(header):
            message = f"this line has {len(cells)} cells, but the header has {len(header)}"
            raise line_error(path, line, message)
        row: dict[str, Any] = {n: cell or None for n, cell in zip(header, cells, strict=True)}
        foot = row.get("foot_x"), row.get("foot_y")
        row["foot"] = None if None in foot else foot
        yield line, row


def _cells(path: Path, line: int, content: str) -> list[str]:
    if '"' not in content and ", " not in content:
        return content.split(",")
    try:
        return next(csv.reader([content], strict=True, skipinitialspace=True), [])
    except csv.Error as error:
        raise line_error(path, line, str(error)) from error


def _begin(path: Path, first: tuple[int | str, float], clock: str | None) -> datetime | None:
    """Return the clock time at time 0 from the position, the time and the clock of a frame."""
    position, time = first
    try:
        return parse_date_time(clock) - timedelta(seconds=time) if clock else None
    except (ValueError, OverflowError) as error:
        raise line_error(path, position, f"clock: {error}") from error


JSON_LINES = Format(
    "JSON lines",
    ".jsonl",
    read_json_lines,
    _json_lines,
    read_head=partial(read_json_lines, is_head=True),
)


CSV = Format("CSV", ".csv", read_csv, _csv_lines, ",".join(_COLUMNS) + "\n", read_head=read_csv)


@dataclass(frozen=True, slots=True)
class _MotRow:
    """The columns that are used."""

    frame: _Whole
    id: _Whole
    left: Number
    top: Number
    width: Number
    height: Number
    score: Number  # in truth, a flag


_MOT_ROW = TypeAdapter(_MotRow)


_NAMES = tuple(_MotRow.__annotations__)


def _mot_lines(frame: FrameTracks) -> Iterator[str]:
    """Yield a line for each box: frame, id, left, top, width, height, score, -1, -1, -1."""
    for track in frame.tracks:
        x, y, width, height = track.box.xywh
        yield (
            f"{frame.index + 1},{track.id},{x + 1},{y + 1},{width},{height},{track.score:.4f},"
            "-1,-1,-1\n"
        )


def read_mot(path: Path, data: bytes) -> SavedTracks:
    """Read results or truth.

    Results have ten columns: frame, id, left, top, width, height, confidence, -1, -1, -1. Truth has
    nine, as in `gt.txt`: frame, id, left, top, width, height, flag, class, visibility. Flag 0 marks
    an ignore region, 1 a vehicle; UAVDT has 1 to 3, by how much of it is outside. The class is not
    used, because its numbers differ between tools; neither is the visibility. Several classes give
    a warning (logger "vdet"). Columns may also be separated by spaces.

    Raises
    ------
    TruthError
        A line has a wrong number of columns, or another one than the first line, a column is not a
        number, or a flag is neither 0 nor 1.
    """
    classes, frames = set[str](), dict[int, list[Track]]()
    for frame, track in _mot_tracks(path, data, classes):
        frames.setdefault(frame, []).append(track)
    if 1 < len(classes) <= _MAX_CLASSES:
        numbers = ", ".join(sorted(classes, key=int))
        _log.warning(
            "%s: column 8 has the classes %s, which are all read as vehicles; keep only the rows "
            "of vehicles",
            path,
            numbers,
        )
    return SavedTracks(frames)


def _mot_tracks(path: Path, data: bytes, classes: set[str]) -> Iterator[tuple[int, Track]]:
    """Yield the frame and the box of each line, and put the classes of vehicles into `classes`."""
    separator = "," if b"," in data.lstrip().partition(b"\n")[0] else None
    counts: tuple[int, ...] = _TRUTH_COLUMNS, _RESULT_COLUMNS
    for line, content in numbered_lines(path, data):
        columns = content.split(separator)
        if len(columns) not in counts:
            numbers = " or ".join(map(str, counts))
            message = f"MOTChallenge has {numbers} columns; this line has {len(columns)}"
            raise line_error(path, line, message)
        counts = (len(columns),)
        is_truth = len(columns) == _TRUTH_COLUMNS
        named = dict(zip(_NAMES, columns, strict=False))
        row = _checked(path, line, _MOT_ROW.validate_python, named)
        if is_truth and row.score not in {0, 1, 2, 3}:
            message = f"with nine columns, column 7 must be a flag, 0 or 1, but is {row.score:g}"
            raise line_error(path, line, f"{message}; a results file needs ten columns")
        if row.score and columns[7].strip().isdecimal():
            classes.add(columns[7].strip())
        box = Box.sized(row.left - 1, row.top - 1, row.width, row.height)
        score, ignored = 1.0 if is_truth else row.score, is_truth and row.score == 0
        yield row.frame - 1, Track(row.id, box, score, "detected", position=line, ignored=ignored)


MOT = Format("MOTChallenge", ".txt", read_mot, _mot_lines)
