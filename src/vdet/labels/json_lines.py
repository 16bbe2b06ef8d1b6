"""A record of JSON for each frame, even one without a box; frames and pixels count from 0."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any, BinaryIO

from pydantic import BaseModel, Field, ValidationError

from vdet.errors import TruthError
from vdet.labels.parsing import LIMIT, JsonNumber, first_mistake, numbered_lines, text_of
from vdet.labels.protocol import Format, SourceVideo
from vdet.labels.rows import MAX_ROWS, Row, limited, line_error
from vdet.labels.saved import SavedTracks
from vdet.lanes.lane import lane_record
from vdet.lanes.road import Road
from vdet.track.track import FrameTracks, Track

MAX_RECORDS = MAX_ROWS
"""Most records in a file."""


class JsonLinesWriter:
    """Writes a record for each frame: `frame`, `time`, `tracks`, and `lane` if it is looked for.

    Parameters
    ----------
    write
        Takes a line of text.
    """

    def __init__(self, write: Callable[[str], object]) -> None:
        self._write = write

    def write(self, frame: FrameTracks, road: Road | None = None) -> None:
        """Add a frame."""
        record: dict[str, Any] = {
            "frame": frame.index,
            "time": round(frame.time, 6),
            "tracks": [_track_record(track) for track in frame.tracks],
        }
        if road:
            record["lane"] = lane_record(road.lane)
        self._write(json.dumps(record) + "\n")

    def end(self) -> None:
        """Do nothing: all records are written."""


def _open(file: BinaryIO, _: SourceVideo | None = None) -> JsonLinesWriter:
    return JsonLinesWriter(lambda text: file.write(text.encode()))


def _track_record(track: Track) -> dict[str, Any]:
    return {
        "id": track.id,
        "x": track.box.x,
        "y": track.box.y,
        "width": track.box.width,
        "height": track.box.height,
        "score": round(track.score, 4),
        "predicted": track.predicted,
        "class": track.class_name,
        "foot": [round(value, 2) for value in track.foot],
        "distance": None if track.distance is None else round(track.distance, 2),
        "lane": track.lane,
    }


_Whole = Annotated[int, Field(ge=0, le=LIMIT, strict=True)]
_Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False, strict=True)]


class _TrackRecord(BaseModel, frozen=True):
    id: _Whole
    x: JsonNumber
    y: JsonNumber
    width: JsonNumber
    height: JsonNumber
    score: _Share = 1.0
    predicted: bool = Field(False, strict=True)
    label: str | None = Field(None, alias="class", strict=True)
    foot: tuple[JsonNumber, JsonNumber] | None = None
    distance: JsonNumber | None = None
    lane: Annotated[int, Field(ge=-LIMIT, le=LIMIT, strict=True)] | None = None


class _FrameRecord(BaseModel, frozen=True):
    frame: _Whole
    time: JsonNumber
    tracks: tuple[_TrackRecord, ...]


def read_json_lines(path: Path, data: bytes) -> SavedTracks:
    """Read a record for every frame; keys that `JsonLinesWriter` does not write are passed over.

    Raises
    ------
    TruthError
        The file is empty, a line is not such a record, or frames do not ascend.
    """
    times: dict[int, float] = {}
    rows = tuple(limited(path, _rows(path, text_of(path, data), times)))
    if not times:
        raise TruthError(f"{path}: is empty; it should have a record for every frame")
    return SavedTracks(rows, listed=tuple(times), times=times)


def _rows(path: Path, text: str, times: dict[int, float]) -> Iterator[Row]:
    """Yield the boxes of every record, and put the time of every frame into `times`."""
    for line, record in _records(path, text):
        times[record.frame] = record.time
        for each in record.tracks:
            yield Row(
                line,
                record.frame + 1,
                each.id,
                *(each.x, each.y, each.width, each.height, each.score),
                label=each.label or None,
                predicted=each.predicted,
                foot=each.foot,
                distance=each.distance,
                lane=each.lane,
            )


def _records(path: Path, text: str) -> Iterator[tuple[int, _FrameRecord]]:
    """Yield the line number and the record of every line; frames must ascend."""
    last = -1
    for count, (line, content) in enumerate(numbered_lines(text)):
        if count == MAX_RECORDS:
            raise line_error(path, line, f"has more than {MAX_RECORDS:,} frames; cut it into parts")
        try:
            record = _FrameRecord.model_validate_json(content)
        except ValidationError as error:
            raise line_error(path, line, first_mistake(error)) from error
        if record.frame <= last:
            raise line_error(path, line, f"frame {record.frame} comes after frame {last}")
        last = record.frame
        yield line, record


JSON_LINES = Format("JSON lines", ".jsonl", _open, read_json_lines)
