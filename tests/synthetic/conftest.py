"""Small scenes with nothing left to chance: no noise, no shadows, a plain road."""

from collections.abc import Callable

import pytest

from vdet.synthetic.camera import Camera
from vdet.synthetic.scene import Light, Line, Road, Scene, Vehicle, Waypoint


@pytest.fixture
def make_scene() -> Callable[..., Scene]:
    """Make a scene of vehicles given by keyword and position, a dashed line to their left."""

    def make(
        *vehicles: Vehicle,
        size: tuple[int, int] = (1280, 720),
        curvature: float = 0.0,
        frames: int = 1,
    ) -> Scene:
        return Scene(
            camera=Camera.dashboard(*size, curvature=curvature),
            road=Road(left=-6.0, right=6.0, lines=(Line(-1.85), Line(1.85, dash=3.0))),
            light=Light(noise=0.0),
            vehicles=vehicles,
            speed=10.0,
            frames=frames,
        )

    return make


@pytest.fixture
def parked() -> Callable[[int, float, float], Vehicle]:
    """Make a red vehicle that keeps its place before the camera for a second."""

    def make(number: int, ahead: float, lateral: float) -> Vehicle:
        path = (Waypoint(0.0, ahead, lateral), Waypoint(1.0, ahead, lateral))
        return Vehicle(number, path, color=(40, 30, 200))

    return make
