"""Boxes with ids, frame by frame: truth and predictions in memory."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vdet.boxes import BoolArray, Float64Array, Int64Array
from vdet.labels.rows import Row, checked_rows


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
        As `checked_rows`.
    """
    checked = checked_rows(path, rows, frame_count=frame_count)
    return LabelledVideo.from_rows(checked, frame_count=frame_count, rate=rate)
