import pytest
from benchmarks.drawn_traffic import traffic_scene

from vdet.synthetic.camera import PinholeCamera
from vdet.synthetic.random_scenes import demo_scene
from vdet.synthetic.scene import Scene
from vdet.synthetic.truth import TrueBox, must_be_found, true_boxes


@pytest.fixture(scope="module", params=[0, 1, 2])
def scene(request: pytest.FixtureRequest) -> Scene:
    return demo_scene(request.param)


@pytest.fixture(scope="module")
def seen(scene: Scene) -> dict[int, tuple[TrueBox, ...]]:
    """The true boxes in every fifth frame."""
    return {index: true_boxes(scene, index) for index in range(0, scene.frames, 5)}


def test_vehicles_leave_enter_and_are_hidden(
    scene: Scene, seen: dict[int, tuple[TrueBox, ...]]
) -> None:
    leaves, enters, passed = (
        [(index, box) for index, boxes in seen.items() for box in boxes if box.id == number]
        for number in (3, 4, 2)
    )
    assert leaves[0][0] == 0
    assert leaves[0][1].hidden == 0
    assert leaves[-1][0] < scene.frames - 50
    assert leaves[-1][1].box.x2 == scene.camera.width, "at the right edge"
    assert enters[0][0] > 25
    assert enters[0][1].box.x2 == scene.camera.width
    assert enters[-1][0] == scene.frames - 5, "and stays"
    hidden = [box.hidden for index, box in passed if index > 110]
    assert hidden[0] < 0.1
    assert max(hidden) > 0.9, "while another vehicle passes"
    assert hidden[-1] < 0.1


CAMERAS = (PinholeCamera.dashboard(1280, 720), PinholeCamera(1242, 375, 721, 172.5, 1.65))


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize(("lane", "hidden"), [(0, {2, 6}), (1, {4}), (2, {2, 6})])
def test_all_vehicles_must_be_found_except_those_that_nearer_ones_hide(
    camera: PinholeCamera, lane: int, hidden: set[int]
) -> None:
    scene = traffic_scene(camera, lane=lane, lanes=3, frames=30, seed=1)
    for index in (0, 15, 29):
        boxes = true_boxes(scene, index)
        assert {box.id for box in boxes} == {1, 2, 3, 4, 5, 6}
        assert {box.id for box in boxes if not must_be_found(box, camera.height)} == hidden
