"""A view cut off by the frame's side tells of the inner edge only."""

import numpy as np
import pytest

from vdet.geometry import Float64Array
from vdet.track.motion.state import MotionState, measurement_of
from vdet.track.motion.views import view

SIZE = (1000, 500)


def expecting(*box: float) -> MotionState:
    return MotionState.at_rest(np.array(box, np.float64), 0.1, 0.1)


def corrected(state: MotionState, *box: float) -> Float64Array:
    """Return the box after a measurement that is believed."""
    seen = view(state, np.array(box, np.float64), SIZE)
    return seen.state.corrected(seen.measured, 1e-6, seen.seen).box


def test_a_whole_view_is_measured_as_it_is() -> None:
    box = np.array([410.0, 210.0, 90.0, 60.0])
    seen = view(expecting(400, 200, 100, 50), box, SIZE)
    assert (seen.measured == measurement_of(box)).all()
    assert (seen.seen == 1).all()


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
    assert corrected(expecting(*before), *cut) == pytest.approx(after, abs=0.01)


def test_an_entering_vehicle_is_as_wide_as_what_is_seen_of_it() -> None:
    box = corrected(expecting(960, 200, 40, 50), 940, 200, 60, 50)
    assert box == pytest.approx([940, 200, 60, 50], abs=0.01)


def test_entering_gives_the_velocity_of_the_inner_edge_and_no_growth() -> None:
    state = expecting(960, 200, 40, 50)
    for left in range(955, 900, -5):
        seen = view(state.predicted(0.01), np.array([left, 200, 1000 - left, 50.0]), SIZE)
        state = seen.state.corrected(seen.measured, 0.1, seen.seen)
    assert state.mean[0, 1] == pytest.approx(-5, abs=0.5)
    assert state.mean[2, 1] == 0


def test_a_growing_vehicle_that_is_cut_off_stops_growing() -> None:
    growing = expecting(850, 200, 100, 50).mean.copy()
    growing[2:, 1] = 0.02
    state = MotionState(growing, expecting(850, 200, 100, 50).covariance)
    assert view(state, np.array([930, 200, 70, 50.0]), SIZE).state.mean[2:, 1].tolist() == [0, 0.02]


def test_a_view_cut_off_on_both_sides_is_measured_as_it_is() -> None:
    box = np.array([0.0, 200.0, 1000.0, 250.0])
    assert (view(expecting(0, 200, 900, 250), box, SIZE).seen == 1).all()
