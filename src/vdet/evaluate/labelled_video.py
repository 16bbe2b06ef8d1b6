"""Boxes with ids, frame by frame: what truth and predictions are in memory."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from vdet.geometry import Float64Array

Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class LabelledVideo:
    """The boxes of a video, one row each, ordered by frame.

    Attributes
    ----------
    frames
        int64 `(n,)`: number of the frame, from 1, ascending.
    ids
        int64 `(n,)`: the vehicle; no id comes twice in a frame, ignore regions (-1) aside.
    boxes
        float64 `(n, 4)`: x, y, width, height in full-frame pixels from 0, each with an area.
    scores
        float64 `(n,)`: confidence, higher is surer; 1 for truth.
    ignored
        bool `(n,)`: the row is an ignore region, not a vehicle to be found.
    frame_count
        Frames of the video, where the file says so.
    rate
        Frames a second, where the file says so.
    """

    frames: Integers
    ids: Integers
    boxes: Float64Array
    scores: Float64Array
    ignored: Flags
    frame_count: int | None = None
    rate: float | None = None

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def last_frame(self) -> int:
        """Number of the last frame that is known of; 0 where there is none."""
        return max(self.frame_count or 0, int(self.frames[-1]) if len(self) else 0)

    def frame(self, number: int) -> "LabelledVideo":
        """Return the rows of one frame, counted from 1, in their order."""
        first, end = np.searchsorted(self.frames, [number, number + 1])
        return self.where(slice(int(first), int(end)))

    def until(self, last: int) -> "LabelledVideo":
        """Return the frames 1 to `last` as a video of that many frames."""
        return replace(self.where(self.frames <= last), frame_count=last)

    def where(self, rows: slice | Flags) -> "LabelledVideo":
        """Return only these rows, in their order."""
        return replace(
            self,
            frames=self.frames[rows],
            ids=self.ids[rows],
            boxes=self.boxes[rows],
            scores=self.scores[rows],
            ignored=self.ignored[rows],
        )
