import numpy as np
import pytest

from vdet.boxes import Float64Array
from vdet.track.motion.state import MotionState

FRAME = 0.04
BOX = np.array([100.0, 50.0, 140.0, 70.0])
LARGE = 2600, 2600
"""A frame whose sides no box touches."""


def sized(x: float, y: float, width: float, height: float) -> Float64Array:
    return np.array([x, y, x + width, y + height], np.float64)


def offset(x: float, y: float, width: float, height: float) -> Float64Array:
    return sized(100 + x, 50 + y, 40 + width, 20 + height)


def still(box: Float64Array = BOX, noise: float = 0.1) -> MotionState:
    return MotionState.at_rest(box, noise, LARGE)


def after(boxes: list[Float64Array], noise: float = 0.1) -> MotionState:
    """Follow boxes, one a frame; the state is that expected for the next."""
    state = still(boxes[0], noise)
    for box in boxes[1:]:
        state = state.predicted(FRAME).corrected(box, noise, LARGE)
    return state.predicted(FRAME)


def test_a_steady_motion_is_predicted_without_lag() -> None:
    state = after([offset(3 * n, n, 0, 0) for n in range(60)])
    assert state.box == pytest.approx(offset(180, 60, 0, 0), abs=0.1)


# Boxes that the frame's sides cut off

SIZE = (1000, 500)


def expecting(*box: float) -> MotionState:
    return MotionState.at_rest(sized(*box), 0.1, SIZE)


def corrected(state: MotionState, *box: float) -> Float64Array:
    """Return the box after a measurement without noise."""
    return state.corrected(sized(*box), 1e-6, SIZE).box


@pytest.mark.parametrize(
    ("before", "cut", "after"),
    [
        ((850, 200, 100, 50), (930, 200, 70, 50), (930, 200, 100, 50)),
        ((50, 200, 100, 50), (0, 200, 70, 50), (-30, 200, 100, 50)),
        ((400, 420, 60, 60), (400, 460, 60, 40), (400, 460, 60, 60)),
        ((400, 20, 60, 60), (400, 0, 60, 40), (400, -20, 60, 60)),
    ],
    ids=["right", "left", "below", "above"],
)
def test_a_leaving_vehicle_keeps_its_size(
    before: tuple[float, ...], cut: tuple[float, ...], after: tuple[float, ...]
) -> None:
    assert corrected(expecting(*before), *cut) == pytest.approx(sized(*after), abs=0.01)


def test_an_entering_vehicle_is_as_wide_as_what_is_seen_of_it() -> None:
    box = corrected(expecting(960, 200, 40, 50), 940, 200, 60, 50)
    assert box == pytest.approx(sized(940, 200, 60, 50), abs=0.01)


@pytest.mark.parametrize("speed", [-1.0, 1.0])
def test_a_vehicle_that_drives_evenly_along_the_road_is_predicted_without_lag(speed: float) -> None:
    """Its place and size change by 1 / distance: in the picture it slows down, or speeds up."""

    def seen(number: int) -> Float64Array:
        distance = (1.0 if speed > 0 else 2.6) + speed * FRAME * number
        size, x, y = 60 / distance, 800 + 300 / distance, 600 + 400 / distance
        return sized(x - size / 2, y - size, size, size)

    state = after([seen(number) for number in range(38)])
    assert state.box == pytest.approx(seen(38), abs=0.05 * (state.box[2] - state.box[0]))


@pytest.mark.parametrize("seconds", [-0.3, 0.3])
def test_what_comes_nearer_moves_slower_in_the_past_and_faster_in_the_future(
    seconds: float,
) -> None:
    state = still()
    state.mean[0, 1], state.mean[2:, 1] = 100, 0.2  # pixels a second; growth a second
    near = 1 / (1 - 0.2 * seconds)
    assert state.moved(seconds)[0] == pytest.approx([120 + 100 * seconds * near, 100 * near**2])
