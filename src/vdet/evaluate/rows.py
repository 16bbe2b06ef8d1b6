"""The rows of a file of boxes, whatever its format: their checks, and their way into memory."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vdet.errors import TruthError
from vdet.evaluate.labelled_video import LabelledVideo

MAX_ROWS = 500_000
"""In one file: five hours of video with one vehicle in sight."""

NO_ID = -1
"""The id of an ignore region that has none; the only id that may come twice in a frame."""


@dataclass(frozen=True, slots=True)
class Row:
    """A box as a reader finds it.

    `line` is its line in the file, `frame` counts from 1, `x`, `y`, `width` and `height` are
    full-frame pixels counted from 0.
    """

    line: int
    frame: int
    id: int
    x: float
    y: float
    width: float
    height: float
    score: float = 1.0
    ignored: bool = False


def refusal(path: Path, line: int, what: str) -> TruthError:
    """Return the error that says what is wrong in a line of a file."""
    return TruthError(f"{path}:{line}: {what}")


def collect(
    path: Path,
    rows: Iterable[Row],
    *,
    frame_count: int | None = None,
    rate: float | None = None,
) -> LabelledVideo:
    """Check the rows of `path` and put them in order of frame (in one frame, as they come).

    Raises
    ------
    TruthError
        A frame before the first or beyond `frame_count`, a negative id of a vehicle, an id twice
        in a frame, a box of no area, or more than `MAX_ROWS` boxes.
    """
    checked: list[Row] = []
    lines: dict[tuple[int, int], int] = {}
    for row in rows:
        if len(checked) == MAX_ROWS:
            raise refusal(path, row.line, f"has more than {MAX_ROWS:,} boxes; cut it into parts")
        complaint = _complaint(row, frame_count)
        key = row.frame, row.id
        if complaint is None and key in lines and row.id != NO_ID:
            complaint = f"id {row.id} is in the same frame already (line {lines[key]})"
        if complaint is not None:
            raise refusal(path, row.line, complaint)
        lines[key] = row.line
        checked.append(row)
    return in_memory(checked, frame_count=frame_count, rate=rate)


def _complaint(row: Row, frame_count: int | None) -> str | None:
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
    return None


def in_memory(
    rows: Iterable[Row], *, frame_count: int | None = None, rate: float | None = None
) -> LabelledVideo:
    """Put rows in order of frame (in one frame, as they come), unchecked."""
    ordered = sorted(rows, key=lambda row: row.frame)
    boxes = [(row.x, row.y, row.width, row.height) for row in ordered]
    return LabelledVideo(
        frames=np.array([row.frame for row in ordered], np.int64),
        ids=np.array([row.id for row in ordered], np.int64),
        boxes=np.array(boxes, np.float64).reshape(-1, 4),
        scores=np.array([row.score for row in ordered], np.float64),
        ignored=np.array([row.ignored for row in ordered], np.bool_),
        frame_count=frame_count,
        rate=rate,
    )
