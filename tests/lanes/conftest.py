"""Generated roads with known lines, and lane settings that fit their camera."""

from collections.abc import Callable

import pytest
from benchmarks.drawn_traffic import lane_view

from vdet.config.schema import LaneSettings
from vdet.lanes.road import Lane, RoadFinder
from vdet.media import Picture
from vdet.synthetic.camera import PinholeCamera
from vdet.synthetic.render import Renderer
from vdet.synthetic.scene import Carriageway, LaneLine, Light, Scene

YELLOW = (60, 180, 225)
NEAR, FAR = 6.0, 42.0


@pytest.fixture(scope="session")
def settings_for() -> Callable[[PinholeCamera], LaneSettings]:
    """Make settings whose top view shows the road from 6 m to 42 m ahead of a level camera."""

    def make(camera: PinholeCamera) -> LaneSettings:
        return lane_view(camera, near=NEAR, far=FAR)

    return make


@pytest.fixture(scope="session")
def make_road() -> Callable[..., Scene]:
    """Make a scene: a yellow line on the left, a dashed white one on the right, 3.7 m apart."""

    def make(
        *,
        curvature: float = 0.0,
        lines: tuple[LaneLine, ...] = (LaneLine(-1.85, YELLOW), LaneLine(1.85, dash=3.0)),
        asphalt: tuple[int, int, int] = (88, 84, 82),
        light: Light | None = None,
        size: tuple[int, int] = (1280, 720),
        frames: int = 4,
    ) -> Scene:
        return Scene(
            camera=PinholeCamera.dashboard(*size, curvature=curvature),
            road=Carriageway(left=-7.0, right=7.0, lines=lines, asphalt=asphalt),
            light=light or Light(),
            frames=frames,
            seed=3,
        )

    return make


@pytest.fixture
def drive(
    settings_for: Callable[[PinholeCamera], LaneSettings],
) -> Callable[..., list[Lane | None]]:
    """Find the lane in each frame of consecutive scenes."""

    def find(*scenes: Scene) -> list[Lane | None]:
        camera = scenes[0].camera
        finder = RoadFinder(None, settings_for(camera), camera.width, camera.height)
        lanes: list[Lane | None] = []
        for scene in scenes:
            renderer = Renderer(scene)
            images = [renderer.image(index) for index in range(scene.frames)]
            lanes += [finder.update(finder.observe(Picture(image))).lane for image in images]
        return lanes

    return find
