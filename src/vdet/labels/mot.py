"""MOTChallenge text: comma-separated columns; frames and pixels count from 1.

Source: Milan et al., "MOT16: A Benchmark for Multi-Object Tracking", 2016, tables 3 and 4.
"""

import logging
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

from pydantic import Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from vdet.labels.formats import Format
from vdet.labels.label import Label, SavedTracks, from_size, line_error
from vdet.labels.parsing import LIMIT, Number, first_mistake, numbered_lines
from vdet.track.track import FrameTracks

_log = logging.getLogger("vdet")
_MAX_CLASSES = 100  # more are positions, in the eighth column of results
_TRUTH_COLUMNS, _RESULT_COLUMNS = 9, 10

_Whole = Annotated[int, Field(ge=-LIMIT, le=LIMIT)]


@dataclass(frozen=True, slots=True)
class _Row:
    """The columns that are used."""

    frame: _Whole
    id: _Whole
    left: Number
    top: Number
    width: Number
    height: Number
    score: Number  # in truth, a flag


_ROW = TypeAdapter(_Row)
_NAMES = tuple(_Row.__annotations__)


def _lines(frame: FrameTracks) -> Iterator[str]:
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
    an ignore region, 1 a vehicle. The class is not used, because its numbers differ between tools;
    neither is the visibility. Several classes give a warning (logger "vdet"). Columns may also be
    separated by spaces.

    Raises
    ------
    TruthError
        A line has a wrong number of columns, or another one than the first line, a column is not a
        number, or a flag is neither 0 nor 1.
    """
    classes = set[str]()
    saved = SavedTracks(tuple(_labels(path, data, classes)))
    if 1 < len(classes) <= _MAX_CLASSES:
        numbers = ", ".join(sorted(classes, key=int))
        _log.warning(
            "%s: column 8 has the classes %s, which are all read as vehicles; keep only the rows "
            "of vehicles",
            path,
            numbers,
        )
    return saved


def _labels(path: Path, data: bytes, classes: set[str]) -> Iterator[Label]:
    """Yield the label of each line, and put the classes of vehicles into `classes`."""
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
        try:
            row = _ROW.validate_python(dict(zip(_NAMES, columns, strict=False)))
        except ValidationError as error:
            raise line_error(path, line, first_mistake(error)) from error
        if is_truth and row.score not in {0, 1}:
            message = f"with nine columns, column 7 must be a flag, 0 or 1, but is {row.score:g}"
            raise line_error(path, line, f"{message}; a results file needs ten columns")
        if row.score and columns[7].strip().isdecimal():
            classes.add(columns[7].strip())
        yield Label(
            position=line,
            box=from_size(row.left - 1, row.top - 1, row.width, row.height),
            frame=row.frame,
            id=row.id,
            score=1.0 if is_truth else row.score,
            ignored=is_truth and row.score == 0,
        )


MOT = Format("MOTChallenge", ".txt", read_mot, _lines)
