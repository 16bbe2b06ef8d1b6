"""A table with a heading, and a row for each box; frames and pixels count from 0."""

import csv
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from vdet.labels.formats import Format, LineWriter
from vdet.labels.label import Label, from_size, limited, line_error
from vdet.labels.parsing import parse_number, parse_whole, text_of
from vdet.labels.video import SavedTracks
from vdet.track.track import FrameTracks

_PLACE = ("x", "y", "width", "height")
_NEEDED = ("frame", "time", "id", *_PLACE)
_OPTIONAL = ("score", "predicted", "class", "foot_x", "foot_y", "distance", "lane")
_YES, _NO = {"1", "true"}, {"0", "false", ""}


def _line(cells: Iterable[object]) -> str:
    file = io.StringIO()
    csv.writer(file, lineterminator="\n").writerow(cells)
    return file.getvalue()


def _lines(frame: FrameTracks) -> Iterator[str]:
    """Yield a row for each box; what is not known is an empty cell."""
    for track in frame.tracks:
        yield _line(
            [
                *(frame.index, f"{frame.time:.6f}", track.id, *track.box.xywh),
                f"{track.score:.4f}",
                int(track.predicted),
                track.class_name,
                *(round(value, 2) for value in track.foot),
                None if track.distance is None else round(track.distance, 2),
                track.lane,
            ]
        )


def read_csv(path: Path, data: bytes) -> SavedTracks:
    """Read a table that has at least the columns frame, time, id, x, y, width and height.

    Columns that vdet does not write are ignored.

    Raises
    ------
    TruthError
        A column is missing or comes twice, a row has another number of cells, or a cell is not
        what its column needs.
    """
    times: dict[int, float] = {}
    labels = tuple(limited(path, _labels(path, text_of(path, data), times)))
    return SavedTracks(labels, times=times)


def _labels(path: Path, text: str, times: dict[int, float]) -> Iterator[Label]:
    """Yield the label of every row, and put the time of its frame into `times`."""
    table = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        header = next(table, [])
        _check_header(header)
        for cells in table:
            if cells:
                label, times[label.frame - 1] = _label(table.line_num, header, cells)
                yield label
    except (ValueError, csv.Error) as error:
        raise line_error(path, max(1, table.line_num), str(error)) from error


def _check_header(header: list[str]) -> None:
    missing = [name for name in _NEEDED if header.count(name) != 1]
    if missing:
        raise ValueError(f"the header must name each of these columns once: {', '.join(missing)}")
    for name in _OPTIONAL:
        if header.count(name) > 1:
            raise ValueError(f"the header names the column {name} twice")


def _label(line: int, header: Sequence[str], cells: Sequence[str]) -> tuple[Label, float]:
    """Return a label, and the time of its frame in seconds."""
    if len(cells) != len(header):
        raise ValueError(f"the header has {len(header)} columns; this line has {len(cells)}")
    cell = dict(zip(header, cells, strict=True))
    x, y, width, height = (parse_number(cell[name]) for name in _PLACE)
    score = parse_number(cell.get("score", "1"))
    if not 0 <= score <= 1:
        raise ValueError(f"the score {score:g} is not between 0 and 1")
    foot_x, foot_y = _known(cell, "foot_x"), _known(cell, "foot_y")
    lane = cell.get("lane", "").strip()
    label = Label(
        line,
        from_size(x, y, width, height),
        cell.get("class") or None,
        parse_whole(cell["frame"]) + 1,
        parse_whole(cell["id"]),
        score,
        predicted=_parse_flag(cell.get("predicted", "0")),
        foot=None if foot_x is None or foot_y is None else (foot_x, foot_y),
        distance=_known(cell, "distance"),
        lane=parse_whole(lane) if lane else None,
    )
    return label, parse_number(cell["time"])


def _known(cell: Mapping[str, str], name: str) -> float | None:
    text = cell.get(name, "").strip()
    return parse_number(text) if text else None


def _parse_flag(text: str) -> bool:
    word = text.strip().lower()
    if word not in _YES | _NO:
        raise ValueError(f"predicted is {text!r:.40}; it must be 0 or 1")
    return word in _YES


_HEADING = _line([*_NEEDED, *_OPTIONAL])
CSV = Format("CSV", ".csv", read_csv, lambda file, _: LineWriter(file, _lines, _HEADING))
