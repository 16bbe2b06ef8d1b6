"""Small scenes without noise and shadows, on a plain road."""

from vdet.synthetic import (
    Carriageway,
    LaneLine,
    Light,
    PinholeCamera,
    Scene,
    SceneVehicle,
    Waypoint,
)


def make_scene(
    *vehicles: SceneVehicle,
    size: tuple[int, int] = (1280, 720),
    curvature: float = 0.0,
    frames: int = 1,
) -> Scene:
    """Return a scene with these vehicles between a solid and a dashed line."""
    lines = (LaneLine(-1.85), LaneLine(1.85, dash=3.0))
    return Scene(
        camera=PinholeCamera.dashboard(*size, curvature=curvature),
        road=Carriageway(left=-6.0, right=6.0, lines=lines),
        light=Light(noise=0.0),
        vehicles=vehicles,
        speed=10.0,
        frames=frames,
    )


def parked(number: int, ahead: float, lateral: float) -> SceneVehicle:
    """Return a red vehicle that keeps its distance from the camera for a second."""
    path = (Waypoint(0.0, ahead, lateral), Waypoint(1.0, ahead, lateral))
    return SceneVehicle(number, path, color=(40, 30, 200))
