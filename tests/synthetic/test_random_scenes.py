import pytest
from benchmarks.drawn_traffic import traffic_scene

from vdet.synthetic.camera import PinholeCamera
from vdet.synthetic.random_scenes import demo_scene
from vdet.synthetic.scene import Scene
from vdet.synthetic.truth import TrueBox, must_be_found, true_boxes


def history(scene: Scene, number: int) -> list[tuple[int, TrueBox]]:
    """Return the frame numbers and boxes of a vehicle, for every fifth frame."""
    return [
        (index, box)
        for index in range(0, scene.frames, 5)
        for box in true_boxes(scene, index)
        if box.id == number
    ]


@pytest.fixture(params=[0, 1, 2])
def scene(request: pytest.FixtureRequest) -> Scene:
    return demo_scene(request.param)


def test_one_vehicle_leaves_at_the_right_edge(scene: Scene) -> None:
    seen = history(scene, 3)
    assert seen[0][0] == 0
    assert seen[0][1].hidden == 0
    assert seen[-1][0] < scene.frames - 50
    assert seen[-1][1].box.x2 == scene.camera.width


def test_one_vehicle_enters_at_the_right_edge_and_stays(scene: Scene) -> None:
    seen = history(scene, 4)
    assert seen[0][0] > 25
    assert seen[0][1].box.x2 == scene.camera.width
    assert seen[-1][0] == scene.frames - 5


def test_one_vehicle_is_hidden_while_another_passes(scene: Scene) -> None:
    late = [box.hidden for index, box in history(scene, 2) if index > 110]
    assert late[0] < 0.1
    assert max(late) > 0.9
    assert late[-1] < 0.1


def test_vehicles_in_full_view_have_the_sizes_that_the_window_sets_cover(scene: Scene) -> None:
    unit = scene.camera.height / 720
    for index in range(0, scene.frames, 5):
        for vehicle in true_boxes(scene, index):
            box = vehicle.box
            if vehicle.hidden == 0 and box.x1 > 0 and box.x2 < scene.camera.width:
                assert 55 * unit < box.width < 420 * unit
                assert 310 * unit < box.y1
                assert box.y2 < 640 * unit


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
