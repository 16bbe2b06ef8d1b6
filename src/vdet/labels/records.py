"""The formats of vdet itself, JSON lines and CSV; frames and pixels count from 0.

JSON lines have a record for each frame, even one without a box. CSV has a row for each box.
"""

import csv
import io
import json
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Annotated, Any, get_type_hints

from pydantic import Field, TypeAdapter, ValidationError
from typing_extensions import TypedDict

from vdet.errors import TruthError
from vdet.labels import parsing
from vdet.labels.formats import Format
from vdet.labels.label import MAX_LABELS, Label, from_size, limited, line_error
from vdet.labels.parsing import Index, Number
from vdet.labels.video import SavedTracks
from vdet.track.track import FrameTracks, State, Track

_NEEDED = ("frame", "time", "id", "x", "y", "width", "height")
_OPTIONAL = ("score", "state", "class", "foot_x", "foot_y", "distance", "lane")


# Dictionaries are read twice as fast as models, and an hour of video has a million boxes.
_Known = TypedDict(
    "_Known",
    {
        "score": Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)],
        "state": State,
        "class": str | None,
        "foot": tuple[Number, Number] | None,
        "distance": Number | None,
        "lane": Annotated[int, Field(ge=-parsing.LIMIT, le=parsing.LIMIT)] | None,
    },
    total=False,
)


class _Track(_Known):
    id: Index
    x: Number
    y: Number
    width: Number
    height: Number


class _Record(TypedDict):
    frame: Index
    time: float
    tracks: list[_Track]


_RECORD = TypeAdapter(_Record)
_KINDS = {"frame": Index, "time": float, "foot_x": Number, "foot_y": Number}
_CELLS: dict[str, TypeAdapter[Any]] = {
    name: TypeAdapter(list[kind | None])  # type: ignore[valid-type]
    for name, kind in {**get_type_hints(_Track, include_extras=True), **_KINDS}.items()
}
"""The columns of a table; an empty cell is None."""
_BLOCK = 300
"""Rows of a table that are read at once, column by column; they fit into the cache."""


def _label(line: int, frame: int, track: _Track) -> Label:
    """Return the label in a frame, counted from 0."""
    box = from_size(track["x"], track["y"], track["width"], track["height"])
    score, state = track.get("score", 1.0), track.get("state", "seen")
    known = track.get("class") or None, frame + 1, track["id"], score, False, state
    return Label(line, box, *known, track.get("foot"), track.get("distance"), track.get("lane"))


def _json_lines(frame: FrameTracks) -> Iterator[str]:
    """Yield a record: `frame`, `time`, `tracks`, and the facts that are known about the frame."""
    tracks = [track_record(track) for track in frame.tracks]
    record = {"frame": frame.index, "time": round(frame.time, 6), "tracks": tracks}
    yield json.dumps({**record, **frame.facts}) + "\n"


def track_record(track: Track) -> dict[str, Any]:
    """Return what is known of a track as values for JSON; boxes are rounded to whole pixels."""
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
    """Yield a row for each box; what is not known is an empty cell."""
    for track in frame.tracks:
        known = track_record(track)
        place, score = track.box.xywh, f"{track.score:.4f}"
        cells = (frame.index, f"{frame.time:.6f}", track.id, *place, score, track.state)
        others = (track.class_name, *known["foot"], known["distance"], known["lane"])
        yield _csv_line((*cells, *others))


def _csv_line(cells: Iterable[object]) -> str:
    file = io.StringIO()
    csv.writer(file, lineterminator="\n").writerow(cells)
    return file.getvalue()


def read_json_lines(path: Path, data: bytes) -> SavedTracks:
    """Read a record for every frame; keys that vdet does not know are ignored.

    Raises
    ------
    TruthError
        The file is empty, a line is not such a record, frames do not ascend, or a time is wrong.
    """
    times: _Times = {}
    labels = tuple(limited(path, _json_labels(path, parsing.text_of(path, data), times)))
    if not times:
        raise TruthError(f"{path}: is empty; it should have a record for every frame")
    return SavedTracks(labels, listed=tuple(times), times=parsing.checked_times(path, times))


_Times = dict[int, tuple[int | str, float]]
"""The line and the time of each frame."""


def _json_labels(path: Path, text: str, times: _Times) -> Iterator[Label]:
    """Yield the boxes of every record, and put the time of every frame into `times`."""
    last = -1
    for line, content in parsing.numbered_lines(text):
        if len(times) == MAX_LABELS:
            raise line_error(path, line, f"has more than {MAX_LABELS:,} frames; cut it into parts")
        try:
            record = _RECORD.validate_json(content, strict=True)
        except ValidationError as error:
            raise line_error(path, line, parsing.first_mistake(error)) from error
        if record["frame"] <= last:
            raise line_error(path, line, f"frame {record['frame']} comes after frame {last}")
        last = record["frame"]
        times[last] = line, record["time"]
        for each in record["tracks"]:
            yield _label(line, last, each)


def read_csv(path: Path, data: bytes) -> SavedTracks:
    """Read a table that has at least the columns frame, time, id, x, y, width and height.

    Columns that vdet does not write are ignored. An empty cell counts as no cell.

    Raises
    ------
    TruthError
        A column is missing or appears twice, a row has another number of cells, a cell is not what
        its column needs, or a time is wrong.
    """
    times: _Times = {}
    labels = tuple(limited(path, _csv_labels(path, parsing.text_of(path, data), times)))
    return SavedTracks(labels, times=parsing.checked_times(path, times))


def _csv_labels(path: Path, text: str, times: _Times) -> Iterator[Label]:
    """Yield the label of every row, and put the time of its frame into `times`."""
    table = csv.reader(parsing.text_file(text, ""), strict=True, skipinitialspace=True)
    try:
        names = next(table, [])
        if any(names.count(name) != 1 for name in _NEEDED):
            needed = ", ".join(_NEEDED)
            raise ValueError(f"the header must name each of these columns once: {needed}")
        rows = ((table.line_num, cells) for cells in table if cells)
        while block := list(islice(rows, _BLOCK)):
            yield from _block_labels(path, names, block, times)
    except (ValueError, csv.Error) as error:
        raise line_error(path, max(1, table.line_num), str(error)) from error


def _block_labels(
    path: Path, names: Sequence[str], block: Sequence[tuple[int, list[str]]], times: _Times
) -> Iterator[Label]:
    """Return the labels of rows, which come with their lines."""
    for line, cells in block:
        if len(cells) != len(names):
            what = f"this line has not the {len(names)} columns of the header"
            raise line_error(path, line, what)
    lines, rows = zip(*block, strict=True)
    known = dict.fromkeys(_CELLS, [None] * len(lines)) | {
        name: _values(path, name, column, lines)
        for name, column in zip(names, zip(*rows, strict=True), strict=True)
        if name in _CELLS
    }
    frames, feet = known["frame"], zip(known["foot_x"], known["foot_y"], strict=True)
    times.update(zip(frames, zip(lines, known["time"], strict=True), strict=True))
    boxes = map(from_size, *(known[name] for name in ("x", "y", "width", "height")))
    scores = [1.0 if score is None else score for score in known["score"]]
    facts = scores, [False] * len(lines), [state or "seen" for state in known["state"]]
    places = [None if None in foot else foot for foot in feet], known["distance"], known["lane"]
    numbers = [frame + 1 for frame in frames], known["id"]
    columns = lines, boxes, known["class"], *numbers, *facts, *places
    return map(Label._make, zip(*columns, strict=True))


def _values(path: Path, name: str, cells: Sequence[str], lines: Sequence[int]) -> list[Any]:
    """Return the values of a column."""
    given = [cell or None for cell in cells] if "" in cells else cells
    if name in _NEEDED and None in given:
        raise line_error(path, lines[given.index(None)], f"{name}: this cell is empty")
    try:
        values: list[Any] = _CELLS[name].validate_python(given)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        raise line_error(path, lines[int(first["loc"][0])], f"{name}: {first['msg']}") from error
    return values


JSON_LINES = Format("JSON lines", ".jsonl", read_json_lines, _json_lines)
CSV = Format("CSV", ".csv", read_csv, _csv_lines, _csv_line([*_NEEDED, *_OPTIONAL]))
