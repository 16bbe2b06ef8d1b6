"""The formats of vdet itself, JSON lines and CSV; frames and pixels count from 0.

JSON lines have a record for each frame, even one without a box. CSV has a row for each box.
"""

import csv
import io
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from operator import itemgetter
from pathlib import Path
from typing import Annotated, Any, get_type_hints

from pydantic import FailFast, Field, TypeAdapter, ValidationError
from typing_extensions import TypedDict

from vdet.errors import TruthError
from vdet.labels.formats import Format
from vdet.labels.label import MAX_LABELS, Label, from_size, limited, line_error
from vdet.labels.parsing import (
    LIMIT,
    Index,
    Number,
    Times,
    checked_times,
    first_mistake,
    numbered_lines,
    text_file,
)
from vdet.labels.video import SavedTracks
from vdet.track.track import FrameTracks, State, Track

_NEEDED = ("frame", "time", "id", "x", "y", "width", "height")
_OPTIONAL = ("score", "state", "class", "foot_x", "foot_y", "distance", "lane")
_COLUMNS = _NEEDED + _OPTIONAL
_BLOCK = 300
"""Rows of a table that are checked at once; they fit into the cache."""
_MAX_COLUMNS = 1000
_MAX_ROW = 100
"""Lines of a row of a table, whose cells may contain line ends."""


# Dictionaries are read twice as fast as models, and an hour of video has a million boxes.
_Known = TypedDict(
    "_Known",
    {
        "score": Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)],
        "state": State,
        "class": str | None,
        "foot": tuple[Number, Number] | None,
        "distance": Number | None,
        "lane": Annotated[int, Field(ge=-LIMIT, le=LIMIT)] | None,
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
    tracks: Annotated[list[_Track], FailFast()]


_KINDS = get_type_hints(_Track, include_extras=True) | {
    "frame": Index,
    "time": float,
    "foot_x": Number,
    "foot_y": Number,
}
_RECORD = TypeAdapter(_Record)
_Row: Any = tuple[  # type: ignore[misc]
    (*(_KINDS[each] for each in _NEEDED), *(_KINDS[each] | None for each in _OPTIONAL))
]
_ROWS: TypeAdapter[list[Any]] = TypeAdapter(list[_Row])


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
    times: Times = {}
    labels = tuple(limited(path, _json_labels(path, data, times)))
    if not times:
        raise TruthError(f"{path}: is empty; it should have a record for every frame")
    return SavedTracks(labels, listed=tuple(times), times=checked_times(path, times))


def _json_labels(path: Path, data: bytes, times: Times) -> Iterator[Label]:
    """Yield the boxes of every record, and put the time of every frame into `times`."""
    last = -1
    for line, content in numbered_lines(path, data):
        if len(times) == MAX_LABELS:
            raise line_error(path, line, f"has more than {MAX_LABELS:,} frames; cut it into parts")
        try:
            record = _RECORD.validate_json(content, strict=True)
        except ValidationError as error:
            raise line_error(path, line, first_mistake(error)) from error
        if record["frame"] <= last:
            raise line_error(path, line, f"frame {record['frame']} comes after frame {last}")
        last = record["frame"]
        times[last] = line, record["time"]
        for each in record["tracks"]:
            box = from_size(each["x"], each["y"], each["width"], each["height"])
            score, state = each.get("score", 1.0), each.get("state", "seen")
            known = each.get("class") or None, last + 1, each["id"], score, False, state
            place = each.get("foot"), each.get("distance"), each.get("lane")
            yield Label(line, box, *known, *place)


def read_csv(path: Path, data: bytes) -> SavedTracks:
    """Read a table that has at least the columns frame, time, id, x, y, width and height.

    Columns that vdet does not write are ignored. An empty cell counts as no cell.

    Raises
    ------
    TruthError
        A column is missing or appears twice, a row has another number of cells, a cell is not what
        its column needs, or a time is wrong.
    """
    times: Times = {}
    labels = tuple(limited(path, _csv_labels(path, data, times)))
    return SavedTracks(labels, times=checked_times(path, times))


def _csv_labels(path: Path, data: bytes, times: Times) -> Iterator[Label]:
    """Yield the label of every row, and put the time of its frame into `times`."""
    rows = _rows(path, data)
    while block := list(islice(rows, _BLOCK)):
        lines, cells = zip(*block, strict=True)
        try:
            values = _ROWS.validate_python(cells)
        except ValidationError as error:
            number, column = error.errors()[0]["loc"][:2]
            what = f"{_COLUMNS[int(column)]}: {error.errors()[0]['msg']}"
            raise line_error(path, lines[int(number)], what) from error
        for line, row in zip(lines, values, strict=True):
            frame, time, id_, x, y, width, height, score, state, name, *foot, metres, lane = row
            times[frame] = line, time
            box, score = from_size(x, y, width, height), 1.0 if score is None else score
            place = None if None in foot else tuple(foot)
            yield Label(
                line, box, name, frame + 1, id_, score, False, state or "seen", place, metres, lane
            )


def _rows(path: Path, data: bytes) -> Iterator[tuple[int, list[str | None]]]:
    """Yield the line of each row and its cells in the order of `_COLUMNS`; None is an empty one."""
    numbered = enumerate(text_file(path, data, ""))
    before = 0  # the line before the row that is read

    def lines() -> Iterator[str]:
        for number, line in numbered:
            if number - before > _MAX_ROW:
                raise ValueError(f"the row has more than {_MAX_ROW} lines; a quote may be missing")
            yield line

    table = csv.reader(lines(), strict=True, skipinitialspace=True)
    try:
        names = next(table, [])
        pick = _picker(names)
        for cells in table:
            before = table.line_num
            if not cells:
                continue
            if len(cells) != len(names):
                raise ValueError(f"this line has not the {len(names)} columns of the header")
            cells.append("")
            yield before, [cell or None for cell in pick(cells)]
    except (ValueError, csv.Error) as error:
        raise line_error(path, max(1, table.line_num), str(error)) from error


def _picker(names: Sequence[str]) -> Callable[[list[str]], tuple[str, ...]]:
    """Return a function that orders the cells of a row as `_COLUMNS`.

    `names` is the header; a column that it does not name is the last cell of the row.
    """
    if len(names) > _MAX_COLUMNS:
        raise ValueError(f"the header has more than {_MAX_COLUMNS:,} columns")
    if any(names.count(name) != 1 for name in _NEEDED):
        needed = ", ".join(_NEEDED)
        raise ValueError(f"the header must name each of these columns once: {needed}")
    return itemgetter(*(names.index(each) if each in names else -1 for each in _COLUMNS))


JSON_LINES = Format("JSON lines", ".jsonl", read_json_lines, _json_lines)
CSV = Format("CSV", ".csv", read_csv, _csv_lines, _csv_line(_COLUMNS))
