"""The tracks of a video in one of three formats, as `vdet detect-video --tracks` writes them."""

import csv
import io
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, Field, ValidationError

from vdet.errors import TruthError
from vdet.evaluate.labelled_video import MAX_ROWS, LabelledVideo, Row, checked_video, line_error
from vdet.evaluate.mot import result_rows
from vdet.evaluate.parsing import (
    LIMIT,
    JsonNumber,
    first_mistake,
    numbered_lines,
    parse_number,
    parse_whole,
    read_text,
)

MAX_RECORDS = MAX_ROWS
"""Most records in a `.jsonl` file."""

_COLUMNS = ("frame", "time", "id", "x", "y", "width", "height")
_SCORE = "score"


def read_predictions(path: Path) -> LabelledVideo:
    """Read tracks; the suffix tells the format.

    * `.txt`: MOTChallenge results: frame, id, left, top, width, height, confidence, -1, -1, -1;
      frames and pixels count from 1. An empty file means that nothing was found.
    * `.csv`: a header with at least frame, time, id, x, y, width, height; frames and pixels count
      from 0. A column score, 0 to 1, is optional.
    * `.jsonl`: a record for every frame of the video with frame, time and tracks, counted from 0
      too. A track may have a score, 0 to 1.

    Other columns and keys are ignored. Tracks without a score have score 1. Times are in seconds;
    two different ones give the frame rate.

    Raises
    ------
    TruthError
        The file cannot be read, has another suffix, or has a mistake; the message names the line.
    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise TruthError(f"{path}: is not tracks; give a .txt, .csv or .jsonl file")
    return reader(path, read_text(path))


def _read_txt(path: Path, text: str) -> LabelledVideo:
    return checked_video(path, result_rows(path, text))


def _read_csv(path: Path, text: str) -> LabelledVideo:
    timed = list(_csv_rows(path, text))
    rate = _rate([(row.frame, time) for row, time in timed])
    return checked_video(path, [row for row, _ in timed], rate=rate)


def _read_jsonl(path: Path, text: str) -> LabelledVideo:
    records = list(_json_records(path, text))
    if not records:
        raise TruthError(f"{path}: is empty; it should have a record for every frame")
    rows = [
        Row(line, record.frame + 1, each.id, each.x, each.y, each.width, each.height, each.score)
        for line, record in records
        for each in record.tracks
    ]
    rate = _rate([(record.frame, record.time) for _, record in records])
    return checked_video(path, rows, frame_count=records[-1][1].frame + 1, rate=rate)


_READERS: dict[str, Callable[[Path, str], LabelledVideo]] = {
    ".txt": _read_txt,
    ".csv": _read_csv,
    ".jsonl": _read_jsonl,
}


def _rate(times: Sequence[tuple[int, float]]) -> float | None:
    """Return frames per second between the earliest and the latest of `(frame, seconds)`."""
    if not times:
        return None
    (first, start), (last, end) = min(times), max(times)
    return (last - first) / (end - start) if last > first and end > start else None


def _csv_rows(path: Path, text: str) -> Iterator[tuple[Row, float]]:
    """Yield every row of a table with its time in seconds."""
    table = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        header = next(table, [])
        _check_header(header)
        for cells in table:
            if cells:
                yield _csv_row(table.line_num, header, cells)
    except (ValueError, csv.Error) as error:
        raise line_error(path, max(1, table.line_num), str(error)) from error


def _check_header(header: list[str]) -> None:
    missing = [name for name in _COLUMNS if header.count(name) != 1]
    if missing:
        raise ValueError(f"the header must name each of these columns once: {', '.join(missing)}")
    if header.count(_SCORE) > 1:
        raise ValueError(f"the header names the column {_SCORE} twice")


def _csv_row(line: int, header: list[str], cells: list[str]) -> tuple[Row, float]:
    if len(cells) != len(header):
        raise ValueError(f"the header has {len(header)} columns; this line has {len(cells)}")
    cell = dict(zip(header, cells, strict=True))
    x, y, width, height = (parse_number(cell[name]) for name in ("x", "y", "width", "height"))
    score = parse_number(cell.get(_SCORE, "1"))
    if not 0 <= score <= 1:
        raise ValueError(f"the score {score:g} is not between 0 and 1")
    frame, track = parse_whole(cell["frame"]) + 1, parse_whole(cell["id"])
    return Row(line, frame, track, x, y, width, height, score), parse_number(cell["time"])


_Whole = Annotated[int, Field(ge=0, le=LIMIT, strict=True)]
_Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False, strict=True)]


class TrackRecord(BaseModel, frozen=True):
    """A track in one frame: id; x, y, width, height in full-frame pixels from 0; score 0 to 1."""

    id: _Whole
    x: JsonNumber
    y: JsonNumber
    width: JsonNumber
    height: JsonNumber
    score: _Share = 1.0


class FrameRecord(BaseModel, frozen=True):
    """A frame, counted from 0, its time in seconds, and its tracks."""

    frame: _Whole
    time: JsonNumber
    tracks: tuple[TrackRecord, ...]


def _json_records(path: Path, text: str) -> Iterator[tuple[int, FrameRecord]]:
    """Yield the line number and the record of every line; frames must ascend."""
    last = -1
    for count, (line, content) in enumerate(numbered_lines(text)):
        if count == MAX_RECORDS:
            raise line_error(path, line, f"has more than {MAX_RECORDS:,} frames; cut it into parts")
        try:
            record = FrameRecord.model_validate_json(content)
        except ValidationError as error:
            raise line_error(path, line, first_mistake(error)) from error
        if record.frame <= last:
            raise line_error(path, line, f"frame {record.frame} comes after frame {last}")
        last = record.frame
        yield line, record
