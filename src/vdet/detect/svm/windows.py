"""Window sets → window positions, and what was found in them.

Source of the overlap rule: seed section 2, "Sliding Windows"; the counts 423 + 408 = 831 for a
1280×720 frame are the original's.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from vdet.config.schema import WindowSettings
from vdet.geometry import Float32Array

Boxes = npt.NDArray[np.int32]
"""Shape `(n, 4)`: x, y, width, height in full-frame pixels."""


@dataclass(frozen=True, slots=True)
class Windows:
    """Searched windows with the probability that each shows a vehicle.

    `boxes` is int32 of shape `(n, 4)`: x, y, width, height in full-frame pixels;
    `probabilities` is float32 of shape `(n,)`, 0 to 1; `shares` is float32 of shape `(n,)`: one
    over the number of windows of the same set that cover a pixel. `vehicles` is float32 of shape
    `(n, 4)`: x, y, width, height of the vehicle that a window shows, which for windows that are no
    detections, and without box regression, is the window itself. Windows and vehicles may reach
    beyond the frame.
    """

    boxes: Boxes
    probabilities: Float32Array
    shares: Float32Array
    vehicles: Float32Array

    def __len__(self) -> int:
        return len(self.boxes)

    def detected(self, probability: float) -> "Windows":
        """Return those of at least this probability, in the same order."""
        keep = self.probabilities >= probability
        return Windows(
            self.boxes[keep], self.probabilities[keep], self.shares[keep], self.vehicles[keep]
        )


def join_windows(parts: Sequence[Windows]) -> Windows:
    """Return the windows of several sets as one; parts in the order given."""
    if not parts:
        return NO_WINDOWS
    return Windows(
        np.concatenate([part.boxes for part in parts]),
        np.concatenate([part.probabilities for part in parts]),
        np.concatenate([part.shares for part in parts]),
        np.concatenate([part.vehicles for part in parts]),
    )


NO_WINDOWS = Windows(
    np.empty((0, 4), np.int32),
    np.empty(0, np.float32),
    np.empty(0, np.float32),
    np.empty((0, 4), np.float32),
)


@dataclass(frozen=True, slots=True)
class WindowGrid:
    """A set's square windows, in columns and rows.

    `size` is a window's side and `step` the distance to the next, frame pixels. The window in
    column i and row j lies at `left + i·step`, `top + j·step`, rounded to whole pixels.
    """

    size: int
    step: Fraction
    left: Fraction
    top: Fraction
    columns: int
    rows: int

    def __len__(self) -> int:
        return self.columns * self.rows

    @property
    def boxes(self) -> Boxes:
        """The windows row by row from the top left, int32 `(rows · columns, 4)`."""
        x = np.array([round(self.left + i * self.step) for i in range(self.columns)], np.int32)
        y = np.array([round(self.top + j * self.step) for j in range(self.rows)], np.int32)
        boxes = np.full((self.rows, self.columns, 4), self.size, np.int32)
        boxes[:, :, 0] = x
        boxes[:, :, 1] = y[:, np.newaxis]
        return boxes.reshape(-1, 4)

    @property
    def share(self) -> float:
        """One over the number of windows that cover a pixel in the middle of the set."""
        along = max(1.0, float(self.size / self.step))
        return 1 / (min(self.columns, along) * min(self.rows, along))


def lay_grid(
    settings: WindowSettings, frame_width: int, frame_height: int, *, cells: int = 8
) -> WindowGrid:
    """Lay a set's windows over its band of rows and the width of the frame.

    With `overlap`, each product is truncated to an integer: step = int(size·(1 - overlap)),
    buffer = int(size·overlap), count = int((span - buffer) / step), across and down, or as many as
    fit. With `step`,
    a whole number of cells, as many windows as the span holds.

    Parameters
    ----------
    settings
        Lengths already scaled to the frame (`scale_lengths`).
    frame_width, frame_height
        Pixels; the band ends where the frame does.
    cells
        Cells across a patch, in which `step` is counted.

    Returns
    -------
    The grid; without windows where the band or the frame is smaller than a window.
    """
    size = settings.size
    bottom = max(settings.bottom, settings.top + size)  # rounding may have cut a row off the band
    spans = frame_width, min(bottom, frame_height) - settings.top
    if size <= 0 or min(spans) < size:
        return WindowGrid(max(1, size), Fraction(1), Fraction(0), Fraction(settings.top), 0, 0)
    step, buffer = _step_and_buffer(settings, cells)
    columns, rows = (
        min(int((span - buffer) / step), int((span - size) / step) + 1) for span in spans
    )
    return WindowGrid(size, step, Fraction(0), Fraction(settings.top), columns, rows)


def _step_and_buffer(settings: WindowSettings, cells: int) -> tuple[Fraction, Fraction]:
    if settings.step is not None:
        step = Fraction(settings.step * settings.size, cells)
        return step, settings.size - step
    assert settings.overlap is not None  # one of the two is always given
    step = Fraction(max(1, int(settings.size * (1 - settings.overlap))))
    return step, Fraction(int(settings.size * settings.overlap))


def every_nth(grid: WindowGrid, n: int, across: int, down: int) -> WindowGrid:
    """Return the grid of every n-th window, from column `across` and row `down` on."""
    return WindowGrid(
        grid.size,
        grid.step * n,
        grid.left + across * grid.step,
        grid.top + down * grid.step,
        len(range(across, grid.columns, n)),
        len(range(down, grid.rows, n)),
    )
