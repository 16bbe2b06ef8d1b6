"""Tracks as JSON lines: a record for every frame of the video."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, Field, ValidationError

from vdet.evaluate.rows import MAX_ROWS, Row, refusal
from vdet.evaluate.text import LIMIT, numbered_lines

MAX_RECORDS = MAX_ROWS

_Whole = Annotated[int, Field(ge=0, le=LIMIT, strict=True)]
_Number = Annotated[float, Field(ge=-LIMIT, le=LIMIT, allow_inf_nan=False, strict=True)]


class Box(BaseModel, frozen=True):
    """A track in a frame: id; x, y, width, height in full-frame pixels from 0."""

    id: _Whole
    x: _Number
    y: _Number
    width: _Number
    height: _Number


class Record(BaseModel, frozen=True):
    """A frame, counted from 0, its time in seconds, and its tracks."""

    frame: _Whole
    time: _Number
    tracks: tuple[Box, ...]


def json_records(path: Path, text: str) -> Iterator[tuple[int, Record]]:
    """Give the line number and the record of every line; other keys are passed over.

    Raises
    ------
    TruthError
        A line is not such a record, its frame does not come after the one before, or there are more
        than `MAX_RECORDS`.
    """
    last = -1
    for count, (line, content) in enumerate(numbered_lines(text)):
        if count == MAX_RECORDS:
            raise refusal(path, line, f"has more than {MAX_RECORDS:,} frames; cut it into parts")
        try:
            record = Record.model_validate_json(content)
        except ValidationError as error:
            raise refusal(path, line, _summary(error)) from error
        if record.frame <= last:
            raise refusal(path, line, f"frame {record.frame} comes after frame {last}")
        last = record.frame
        yield line, record


def rows_of(line: int, record: Record) -> Iterator[Row]:
    """Give the rows of a record."""
    for box in record.tracks:
        yield Row(line, record.frame + 1, box.id, box.x, box.y, box.width, box.height)


def _summary(error: ValidationError) -> str:
    first = error.errors(include_url=False, include_input=False, include_context=False)[0]
    place = ".".join(str(part) for part in first["loc"])
    return f"{place}: {first['msg']}" if place else first["msg"]
