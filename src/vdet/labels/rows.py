"""Boxes as they stand in files, and the checks that hold for every format."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from vdet.errors import TruthError

MAX_ROWS = 500_000
"""Most boxes in one file: five hours of video with one vehicle in sight."""

MAX_IN_FRAME = 1000
"""Most boxes of either kind, true or predicted, in one frame."""

NO_ID = -1
"""Id of an ignore region without an id; the only id that may occur twice in a frame."""

_MAX_LABEL = 100  # characters


@dataclass(frozen=True, slots=True)
class Row:
    """A box as it stands in a file.

    Attributes
    ----------
    line
        Its line in the file, or other words for its place, such as "annotations.3".
    frame
        Counted from 1.
    x, y, width, height
        Full-frame pixels counted from 0.
    score
        Confidence, higher is better; 1 where the file has none.
    ignored
        Whether it is an ignore region, and not a vehicle.
    label
        What the file calls it; None where the file has no names.
    predicted, foot, distance, lane
        As in `vdet.track.track.Track`; None where the file does not say.
    """

    line: int | str
    frame: int
    id: int
    x: float
    y: float
    width: float
    height: float
    score: float = 1.0
    ignored: bool = False
    label: str | None = None
    predicted: bool = False
    foot: tuple[float, float] | None = None
    distance: float | None = None
    lane: int | None = None


def line_error(path: Path, line: int | str, what: str) -> TruthError:
    """Return the error that says what is wrong in a line, or another place, of a file."""
    return TruthError(f"{path}:{line}: {what}")


def limited(path: Path, rows: Iterable[Row]) -> Iterator[Row]:
    """Yield the rows of a file. Raises `TruthError` if there are more than `MAX_ROWS`."""
    for count, row in enumerate(rows):
        if count == MAX_ROWS:
            raise line_error(path, row.line, f"has more than {MAX_ROWS:,} boxes; cut it into parts")
        yield row


def checked_rows(
    path: Path, rows: Iterable[Row], *, frame_count: int | None = None
) -> tuple[Row, ...]:
    """Return the rows of the file `path` if they can all be boxes of one video.

    Raises
    ------
    TruthError
        A frame before the first or beyond `frame_count`, a negative id of a vehicle, an id twice
        in a frame, a box without area, or a label of more than 100 characters.
    """
    checked: list[Row] = []
    lines: dict[tuple[int, int], int | str] = {}
    for row in rows:
        mistake = _mistake_in(row, frame_count)
        key = row.frame, row.id
        if mistake is None and key in lines and row.id != NO_ID:
            mistake = f"id {row.id} is in the same frame already ({_named(lines[key])})"
        if mistake is not None:
            raise line_error(path, row.line, mistake)
        lines[key] = row.line
        checked.append(row)
    return tuple(checked)


def _named(line: int | str) -> str:
    return f"line {line}" if isinstance(line, int) else line


def _mistake_in(row: Row, frame_count: int | None) -> str | None:
    if row.frame < 1:
        return "the frame comes before the video's first"
    if frame_count is not None and row.frame > frame_count:
        return (
            f"the frame is number {row.frame} of a video of {frame_count}; is it another video's?"
        )
    if row.id < (NO_ID if row.ignored else 0):
        return f"id {row.id} is negative; number the vehicles from 0 or 1"
    if row.width <= 0 or row.height <= 0 or row.width * row.height <= 0:
        return f"the box has no area: {row.width:g} wide, {row.height:g} high"
    if len(row.label or "") > _MAX_LABEL:
        return f"the label has more than {_MAX_LABEL} characters; give a shorter one"
    return None
