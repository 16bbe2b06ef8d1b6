"""A table with a heading, and a row for each box; frames and pixels count from 0."""

import csv
import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import BinaryIO, TypeVar

from vdet.labels.parsing import parse_number, parse_whole, text_of
from vdet.labels.protocol import Format, SourceVideo
from vdet.labels.rows import Row, limited, line_error
from vdet.labels.saved import SavedTracks
from vdet.lanes.road import Road
from vdet.track.track import FrameTracks, Track

_PLACE = ("x", "y", "width", "height")
_NEEDED = ("frame", "time", "id", *_PLACE)
_OPTIONAL = ("score", "predicted", "class", "foot_x", "foot_y", "distance", "lane")
_YES, _NO = {"1", "true"}, {"0", "false", ""}

T = TypeVar("T")


class _Encoder:
    """What `csv.writer` needs of a file: it takes text, and writes UTF-8."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file

    def write(self, text: str) -> int:
        return self._file.write(text.encode())


class CsvWriter:
    """Writes the heading, and then a row for each box."""

    def __init__(self, file: BinaryIO, _: SourceVideo | None = None) -> None:
        self._rows = csv.writer(_Encoder(file), lineterminator="\n")
        self._rows.writerow([*_NEEDED, *_OPTIONAL])

    def write(self, frame: FrameTracks, road: Road | None = None) -> None:  # noqa: ARG002
        """Add the boxes of a frame."""
        for track in frame.tracks:
            self._rows.writerow([frame.index, f"{frame.time:.6f}", track.id, *_cells(track)])

    def end(self) -> None:
        """Do nothing: all rows are written."""


def _cells(track: Track) -> list[object]:
    """Return what is written of a track, without its id; what is not known is an empty cell."""
    return [
        *(getattr(track.box, name) for name in _PLACE),
        f"{track.score:.4f}",
        int(track.predicted),
        track.class_name,
        *(round(value, 2) for value in track.foot),
        None if track.distance is None else round(track.distance, 2),
        track.lane,
    ]


def read_csv(path: Path, data: bytes) -> SavedTracks:
    """Read a table that has at least the columns frame, time, id, x, y, width and height.

    Other columns that `CsvWriter` does not write are passed over.

    Raises
    ------
    TruthError
        A column is missing or comes twice, a row has another number of cells, or a cell is not
        what its column needs.
    """
    times: dict[int, float] = {}
    rows = tuple(limited(path, _rows(path, text_of(path, data), times)))
    return SavedTracks(rows, times=times)


def _rows(path: Path, text: str, times: dict[int, float]) -> Iterator[Row]:
    """Yield every row of a table, and put the time of its frame into `times`."""
    table = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        header = next(table, [])
        _check_header(header)
        for cells in table:
            if cells:
                row, times[row.frame - 1] = _row(table.line_num, header, cells)
                yield row
    except (ValueError, csv.Error) as error:
        raise line_error(path, max(1, table.line_num), str(error)) from error


def _check_header(header: list[str]) -> None:
    missing = [name for name in _NEEDED if header.count(name) != 1]
    if missing:
        raise ValueError(f"the header must name each of these columns once: {', '.join(missing)}")
    for name in _OPTIONAL:
        if header.count(name) > 1:
            raise ValueError(f"the header names the column {name} twice")


def _row(line: int, header: Sequence[str], cells: Sequence[str]) -> tuple[Row, float]:
    """Return a row, and the time of its frame in seconds."""
    if len(cells) != len(header):
        raise ValueError(f"the header has {len(header)} columns; this line has {len(cells)}")
    cell = dict(zip(header, cells, strict=True))
    x, y, width, height = (parse_number(cell[name]) for name in _PLACE)
    score = parse_number(cell.get("score", "1"))
    if not 0 <= score <= 1:
        raise ValueError(f"the score {score:g} is not between 0 and 1")
    foot = _known(cell, "foot_x", parse_number), _known(cell, "foot_y", parse_number)
    row = Row(
        line,
        parse_whole(cell["frame"]) + 1,
        parse_whole(cell["id"]),
        *(x, y, width, height, score),
        label=cell.get("class") or None,
        predicted=_parse_flag(cell.get("predicted", "0")),
        foot=None if foot[0] is None or foot[1] is None else (foot[0], foot[1]),
        distance=_known(cell, "distance", parse_number),
        lane=_known(cell, "lane", parse_whole),
    )
    return row, parse_number(cell["time"])


def _known(cell: Mapping[str, str], name: str, parse: Callable[[str], T]) -> T | None:
    text = cell.get(name, "").strip()
    return parse(text) if text else None


def _parse_flag(text: str) -> bool:
    word = text.strip().lower()
    if word not in _YES | _NO:
        raise ValueError(f"predicted is {text!r:.40}; it must be 0 or 1")
    return word in _YES


CSV = Format("CSV", ".csv", CsvWriter, read_csv)
