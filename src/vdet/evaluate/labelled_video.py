"""Boxes with ids, frame by frame: truth and predictions in memory, and the checks of their rows."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vdet.errors import TruthError
from vdet.geometry import BoolArray, Float64Array, Int64Array

MAX_ROWS = 500_000
"""Most boxes in one file: five hours of video with one vehicle in sight."""

NO_ID = -1
"""Id of an ignore region without an id; the only id that may occur twice in a frame."""


@dataclass(frozen=True, slots=True)
class Row:
    """A box as it stands in a file.

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


@dataclass(frozen=True, slots=True, eq=False)
class LabelledVideo:
    """The boxes of a video, one row each, ordered by frame.

    Attributes
    ----------
    frames
        int64 `(n,)`: number of the frame, from 1, ascending.
    ids
        int64 `(n,)`: id of the vehicle. No id occurs twice in a frame, except `NO_ID`.
    boxes
        float64 `(n, 4)`: x, y, width, height in full-frame pixels from 0, each with an area.
    scores
        float64 `(n,)`: confidence of a prediction, higher is better; 1 for truth.
    ignored
        bool `(n,)`: of truth, the row is an ignore region, not a vehicle to be found; of
        predictions, it counts only if it finds a vehicle.
    frame_count
        Number of frames of the video, None if the file does not say.
    rate
        Frames per second, None if the file does not say.
    """

    frames: Int64Array
    ids: Int64Array
    boxes: Float64Array
    scores: Float64Array
    ignored: BoolArray
    frame_count: int | None = None
    rate: float | None = None

    @staticmethod
    def from_rows(
        rows: Iterable[Row], *, frame_count: int | None = None, rate: float | None = None
    ) -> "LabelledVideo":
        """Order rows by frame, without checks; rows of one frame keep their order."""
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

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def last_frame(self) -> int:
        """Number of the video's last frame as far as it is known; 0 if there is none."""
        return max(self.frame_count or 0, int(self.frames[-1]) if len(self) else 0)

    def frame(self, number: int) -> "LabelledVideo":
        """Return the rows of one frame, counted from 1, in their order."""
        first, end = np.searchsorted(self.frames, [number, number + 1])
        return self.where(slice(int(first), int(end)))

    def until(self, last: int) -> "LabelledVideo":
        """Return the frames 1 to `last` as a video of that many frames."""
        return replace(self.where(self.frames <= last), frame_count=last)

    def where(self, rows: slice | BoolArray) -> "LabelledVideo":
        """Return only these rows, in their order."""
        return replace(
            self,
            frames=self.frames[rows],
            ids=self.ids[rows],
            boxes=self.boxes[rows],
            scores=self.scores[rows],
            ignored=self.ignored[rows],
        )


def checked_video(
    path: Path,
    rows: Iterable[Row],
    *,
    frame_count: int | None = None,
    rate: float | None = None,
) -> LabelledVideo:
    """Check the rows of the file `path` and order them by frame.

    Raises
    ------
    TruthError
        A frame before the first or beyond `frame_count`, a negative id of a vehicle, an id twice
        in a frame, a box without area, or more than `MAX_ROWS` boxes.
    """
    checked: list[Row] = []
    lines: dict[tuple[int, int], int] = {}
    for row in rows:
        if len(checked) == MAX_ROWS:
            raise line_error(path, row.line, f"has more than {MAX_ROWS:,} boxes; cut it into parts")
        mistake = _mistake_in(row, frame_count)
        key = row.frame, row.id
        if mistake is None and key in lines and row.id != NO_ID:
            mistake = f"id {row.id} is in the same frame already (line {lines[key]})"
        if mistake is not None:
            raise line_error(path, row.line, mistake)
        lines[key] = row.line
        checked.append(row)
    return LabelledVideo.from_rows(checked, frame_count=frame_count, rate=rate)


def line_error(path: Path, line: int, what: str) -> TruthError:
    """Return the error that says what is wrong in a line of a file."""
    return TruthError(f"{path}:{line}: {what}")


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
    return None
