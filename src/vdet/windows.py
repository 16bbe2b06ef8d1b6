"""Window sets → window positions, and what was found in them.

Source of the positions' rule: seed section 2, "Sliding Windows"; the counts 423 + 408 = 831 for a
1280×720 frame are the original's.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vdet.config.schema import WindowSettings

Boxes = npt.NDArray[np.int32]
"""Shape `(n, 4)`: x, y, width, height in full-frame pixels."""


@dataclass(frozen=True, slots=True)
class Windows:
    """Searched windows with the probability that each shows a vehicle.

    `boxes` is int32 of shape `(n, 4)`: x, y, width, height in full-frame pixels;
    `probabilities` is float32 of shape `(n,)`, 0 to 1.
    """

    boxes: Boxes
    probabilities: npt.NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.boxes)

    def detected(self, probability: float) -> "Windows":
        """Return those of at least this probability, in the same order."""
        keep = self.probabilities >= probability
        return Windows(self.boxes[keep], self.probabilities[keep])


def positions(settings: WindowSettings, frame_width: int) -> Boxes:
    """Lay a set's windows over its band of rows, row by row from the top left.

    Each product is truncated to an integer: step = int(size·(1 - overlap)),
    buffer = int(size·overlap), count = int((span - buffer) / step), across and down; one less
    where, by that truncation, the last window would stick out by a pixel.

    Parameters
    ----------
    settings
        Lengths already scaled to the frame (`scale_lengths`).
    frame_width
        Pixels.

    Returns
    -------
    int32 of shape `(rows · columns, 4)`; empty where the band or the frame is smaller than a
    window.
    """
    size = settings.size
    step = max(1, int(size * (1 - settings.overlap)))
    buffer = int(size * settings.overlap)
    columns = _count(frame_width, size, step, buffer)
    rows = _count(settings.bottom - settings.top, size, step, buffer)
    y, x = np.divmod(np.arange(rows * columns, dtype=np.int32), max(1, columns))
    side = np.full_like(x, size)
    return np.stack([x * step, settings.top + y * step, side, side], axis=1)


def _count(span: int, size: int, step: int, buffer: int) -> int:
    if not 0 < size <= span:
        return 0
    return min((span - buffer) // step, (span - size) // step + 1)
