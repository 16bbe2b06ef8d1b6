"""Generated roads with known lines, and lane settings that fit their camera."""

from benchmarks.drawn_traffic import lane_view

from vdet.config.schema import LaneSettings
from vdet.lanes.road import Lane, RoadFinder
from vdet.media import Picture
from vdet.synthetic import Carriageway, LaneLine, Light, PinholeCamera, Renderer, Scene

YELLOW = (60, 180, 225)


def settings_for(camera: PinholeCamera) -> LaneSettings:
    """Return settings whose top view shows the road from 6 m to 42 m ahead of a level camera."""
    return lane_view(camera, near=6, far=42)


def make_road(
    *,
    curvature: float = 0.0,
    lines: tuple[LaneLine, ...] = (LaneLine(-1.85, YELLOW), LaneLine(1.85, dash=3.0)),
    asphalt: tuple[int, int, int] = (88, 84, 82),
    light: Light | None = None,
    size: tuple[int, int] = (1280, 720),
    frames: int = 4,
) -> Scene:
    """Return a scene: a yellow line on the left, a dashed white one on the right, 3.7 m apart."""
    return Scene(
        camera=PinholeCamera.dashboard(*size, curvature=curvature),
        road=Carriageway(left=-7.0, right=7.0, lines=lines, asphalt=asphalt),
        light=light or Light(),
        frames=frames,
        seed=3,
    )


def drive(*scenes: Scene) -> list[Lane | None]:
    """Find the lane in each frame of consecutive scenes."""
    camera = scenes[0].camera
    finder = RoadFinder(None, settings_for(camera), camera.width, camera.height)
    lanes: list[Lane | None] = []
    for scene in scenes:
        renderer = Renderer(scene)
        images = [renderer.image(index) for index in range(scene.frames)]
        lanes += [finder.update(finder.observe(Picture(image))).lane for image in images]
    return lanes
