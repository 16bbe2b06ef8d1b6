"""A record of JSON for each frame, even one without a box; frames and pixels count from 0."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, Field, ValidationError

from vdet.errors import TruthError
from vdet.labels.formats import Format, LineWriter
from vdet.labels.label import MAX_LABELS, Label, from_size, limited, line_error
from vdet.labels.parsing import LIMIT, JsonNumber, first_mistake, numbered_lines, text_of
from vdet.labels.video import SavedTracks
from vdet.track.track import FrameTracks, Track


def _lines(frame: FrameTracks) -> Iterator[str]:
    """Yield a record: `frame`, `time`, `tracks`, and the facts that are known about the frame."""
    tracks = [_track_record(track) for track in frame.tracks]
    record = {"frame": frame.index, "time": round(frame.time, 6), "tracks": tracks}
    yield json.dumps({**record, **frame.facts}) + "\n"


def _track_record(track: Track) -> dict[str, Any]:
    x, y, width, height = track.box.xywh
    return {
        "id": track.id,
        "x": x,
        "y": y,
        "width": width,
        "height": height,
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
    """Read a record for every frame; keys that vdet does not know are ignored.

    Raises
    ------
    TruthError
        The file is empty, a line is not such a record, or frames do not ascend.
    """
    times: dict[int, float] = {}
    labels = tuple(limited(path, _labels(path, text_of(path, data), times)))
    if not times:
        raise TruthError(f"{path}: is empty; it should have a record for every frame")
    return SavedTracks(labels, listed=tuple(times), times=times)


def _labels(path: Path, text: str, times: dict[int, float]) -> Iterator[Label]:
    """Yield the boxes of every record, and put the time of every frame into `times`."""
    last = -1
    for count, (line, content) in enumerate(numbered_lines(text)):
        if count == MAX_LABELS:
            raise line_error(path, line, f"has more than {MAX_LABELS:,} frames; cut it into parts")
        try:
            record = _FrameRecord.model_validate_json(content)
        except ValidationError as error:
            raise line_error(path, line, first_mistake(error)) from error
        if record.frame <= last:
            raise line_error(path, line, f"frame {record.frame} comes after frame {last}")
        last = record.frame
        times[record.frame] = record.time
        for each in record.tracks:
            yield Label(
                line,
                from_size(each.x, each.y, each.width, each.height),
                each.label or None,
                record.frame + 1,
                each.id,
                each.score,
                predicted=each.predicted,
                foot=each.foot,
                distance=each.distance,
                lane=each.lane,
            )


JSON_LINES = Format(
    "JSON lines", ".jsonl", read_json_lines, lambda file, _: LineWriter(file, _lines)
)
