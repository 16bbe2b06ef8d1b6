import math
from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from benchmarks.drawn_traffic import true_places

from synthetic.scenes import make_scene, parked
from vdet.boxes import Box
from vdet.synthetic.render import STANDS, Renderer, TrueBox, must_be_found, true_boxes
from vdet.synthetic.scene import Scene, Waypoint

SIZES = [(1280, 720), (640, 360), (1242, 375)]


def drawn(scene: Scene) -> npt.NDArray[np.bool_]:
    """Return the pixels that differ from those of the same road without vehicles."""
    empty = Renderer(replace(scene, vehicles=())).image(0)
    return np.asarray(cv2.absdiff(Renderer(scene).image(0), empty).max(axis=2) > 12)


def drawn_box(scene: Scene) -> Box:
    return Box.sized(*cv2.boundingRect(drawn(scene).astype(np.uint8)))


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize(("ahead", "lateral"), [(9.0, 0.0), (12.0, 3.7), (25.0, -3.7)])
def test_the_true_box_bounds_what_is_drawn(
    size: tuple[int, int], ahead: float, lateral: float
) -> None:
    scene = make_scene(parked(1, ahead, lateral), size=size)
    [found] = true_boxes(scene, 0)
    assert found.box.pixels == pytest.approx(drawn_box(scene).pixels, abs=2)
    assert found.hidden == 0


@pytest.mark.parametrize("heading", [math.pi / 2, math.pi, -2.0])
def test_a_vehicle_may_drive_in_any_direction(heading: float) -> None:
    turned = replace(parked(1, 15.0, 0.0), path=(Waypoint(0.0, 18.0, -1.0, heading),))
    [found] = true_boxes(make_scene(turned), 0)
    assert found.box.pixels == pytest.approx(drawn_box(make_scene(turned)).pixels, abs=2)
    length = abs(math.sin(heading)) * turned.body.length
    assert found.box.width / found.box.height > 1 + length / 5


def test_a_vehicle_right_behind_a_nearer_one_is_hidden_but_keeps_its_box() -> None:
    alone = true_boxes(make_scene(parked(2, 30.0, 0.0)), 0)[0]
    front, back = true_boxes(make_scene(parked(1, 10.0, 0.0), parked(2, 30.0, 0.0)), 0)
    assert back.box == alone.box
    assert back.hidden == 1
    assert front.hidden == 0


def test_hidden_is_the_fraction_of_the_farther_vehicle_that_the_nearer_one_covers() -> None:
    near, far = parked(1, 12.0, 0.0), parked(2, 30.0, 2.0)
    front, back = drawn(make_scene(near)), drawn(make_scene(far))
    covered = (front & back).sum() / back.sum()
    assert 0.2 < covered < 0.8
    found = true_boxes(make_scene(near, far), 0)[1]
    assert found.hidden == pytest.approx(covered, abs=0.05)


def test_places_are_those_of_the_rear_tyres_and_lanes_are_counted_by_lines() -> None:
    vehicles = [(5, 10.0, 0.3), (1, 30.0, -3.7), (2, 25.0, 2.0), (7, -8.0, 3.7)]
    scene = make_scene(*(parked(*vehicle) for vehicle in vehicles))
    found = {
        place.id: (place.distance, place.lateral, place.lane) for place in true_places(scene, 0)
    }
    assert list(found) == [1, 2, 5, 7]
    assert found == {
        number: pytest.approx((ahead + STANDS, lateral, lane))
        for (number, ahead, lateral), lane in zip(vehicles, (0, -1, 1, 1), strict=True)
    }


@pytest.mark.parametrize(
    ("width", "height", "hidden", "expected"),
    [(40, 24, 0.5, True), (39, 24, 0.0, False), (40, 23, 0.0, False), (90, 60, 0.51, False)],
)
def test_a_vehicle_must_be_found_if_it_is_large_and_half_of_it_is_not_hidden(
    width: int, height: int, hidden: float, expected: bool
) -> None:
    vehicle = TrueBox(1, Box.sized(0, 0, width, height), hidden)
    assert must_be_found(vehicle, 720) is expected
