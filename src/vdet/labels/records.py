"""The formats of vdet itself, JSON lines and CSV; frames and pixels count from 0.

JSON lines have a record for each frame, even one without a box. CSV has a row for each box.
"""

import csv
import io
import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any, Required

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
_Track = TypedDict(
    "_Track",
    {
        "id": Required[Index],
        "x": Required[Number],
        "y": Required[Number],
        "width": Required[Number],
        "height": Required[Number],
        "score": Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)],
        "state": State,
        "class": str | None,
        "foot": tuple[Number, Number] | None,
        "distance": Number | None,
        "lane": Annotated[int, Field(ge=-parsing.LIMIT, le=parsing.LIMIT)] | None,
    },
    total=False,
)


class _Record(TypedDict):
    frame: Index
    time: float
    tracks: list[_Track]


class _Row(_Track):
    frame: Index
    time: float


_RECORD, _ROW = TypeAdapter(_Record), TypeAdapter(_Row)


def _label(line: int, frame: int, track: _Track) -> Label:
    """Return the label in a frame, counted from 0."""
    return Label(
        line,
        from_size(track["x"], track["y"], track["width"], track["height"]),
        track.get("class") or None,
        frame + 1,
        track["id"],
        track.get("score", 1.0),
        False,
        track.get("state", "seen"),
        track.get("foot"),
        track.get("distance"),
        track.get("lane"),
    )


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
        "foot": [round(value, 2) for value in track.foot],
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
        for cells in filter(None, table):
            if len(cells) != len(names):
                raise ValueError(f"this line has not the {len(names)} columns of the header")
            row: dict[str, Any] = {n: cell for n, cell in zip(names, cells, strict=True) if cell}
            if "foot_x" in row and "foot_y" in row:
                row["foot"] = row["foot_x"], row["foot_y"]
            checked = _ROW.validate_python(row)
            times[checked["frame"]] = table.line_num, checked["time"]
            yield _label(table.line_num, checked["frame"], checked)
    except ValueError as error:  # also a ValidationError
        raise line_error(path, max(1, table.line_num), parsing.first_mistake(error)) from error
    except csv.Error as error:
        raise line_error(path, max(1, table.line_num), str(error)) from error


JSON_LINES = Format("JSON lines", ".jsonl", read_json_lines, _json_lines)
CSV = Format("CSV", ".csv", read_csv, _csv_lines, _csv_line([*_NEEDED, *_OPTIONAL]))
