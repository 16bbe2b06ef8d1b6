"""Vehicles that the frame's sides cut off: what of them can be measured.

The box of a vehicle that comes in at a side grows with every frame though the vehicle does not,
and its centre moves at half the vehicle's speed. So of a cut-off view only the inner edge counts;
the width is what it was, or what is to be seen if that is more, and does not change by itself.
Above and below it is the same with the height.
"""

from dataclasses import dataclass

import numpy as np

from vdet.geometry import Float64Array
from vdet.track.motion.state import MotionState, measurement_of

BORDER = 0.005
"""A box that ends this near to the frame's side, as a share of the frame, touches it."""


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """What a region tells of a vehicle.

    `state` is the state that it is to correct, `measured` and `seen` are as
    `MotionState.corrected` takes them.
    """

    state: MotionState
    measured: Float64Array
    seen: Float64Array


def view(state: MotionState, box: Float64Array, size: tuple[int, int]) -> View:
    """Compare the region `box` with the predicted `state`.

    Parameters
    ----------
    box
        x, y, width, height in full-frame pixels, inside the frame, with an area.
    size
        Width and height of the frame, pixels.
    """
    mean, covariance = state.mean.copy(), state.covariance.copy()
    measured, seen = measurement_of(box), np.ones(4)
    for axis, span in enumerate(size):
        first, last = box[axis], box[axis] + box[axis + 2]
        cut_before, cut_behind = first <= BORDER * span, last >= span - BORDER * span
        if cut_before == cut_behind:
            continue
        outward = 1 if cut_behind else -1
        length = np.exp(mean[axis + 2, 0])
        if last - first > length:
            mean[axis, 0] += outward * (last - first - length) / 2  # the inner edge stays
            mean[axis + 2, 0] = measured[axis + 2]
            length = last - first
        mean[axis + 2, 1] = 0
        measured[axis] = (first if cut_behind else last) + outward * length / 2
        seen[axis + 2] = 0
    return View(MotionState(mean, covariance), measured, seen)
