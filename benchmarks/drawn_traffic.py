"""Drawn roads with traffic in every lane: their views, what is shown of them, and the truth."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import numpy as np

from vdet.config.schema import LaneSettings, Settings
from vdet.detect.detectors import DetectorModel
from vdet.labels.label import SavedTracks
from vdet.media import Frame, Picture, Planes, VideoInfo
from vdet.media.frame import Coding
from vdet.run.loop import Parts, build, peek
from vdet.run.steps import FrameResult, Step
from vdet.synthetic import (
    LANE_WIDTH,
    STANDS,
    Light,
    PinholeCamera,
    Scene,
    SceneVehicle,
    Waypoint,
    empty_road,
    must_be_found,
    random_body,
    random_paint,
    true_boxes,
)
from vdet.track.track import Track


def traffic_scene(
    camera: PinholeCamera,
    *,
    lane: int,
    lanes: int,
    frames: int,
    seed: int,
    light: Light | None = None,
) -> Scene:
    """Return a scene at 25 frames a second with a near and a far vehicle in each lane.

    All vehicles drive at constant speeds, a little faster than the camera. The camera is in lane
    `lane` of `lanes`, counted from 0 at the left. Ids count from 1 at the left, near before far.
    Without `light`, the light is random like the rest.
    """
    rng = np.random.default_rng(seed)
    scene = empty_road(rng, camera, lane=lane, lanes=lanes, seed=seed)
    rate = Fraction(25)
    end = float(frames / rate)
    paths = [
        (Waypoint(0.0, ahead, lateral), Waypoint(end, ahead + gained, lateral))
        for lateral in ((number - lane) * LANE_WIDTH for number in range(lanes))
        for ahead, gained in ((9 + 1.2 * abs(lateral), 2 * end), (24 + abs(lateral), 3 * end))
    ]
    vehicles = tuple(
        SceneVehicle(number, path, random_paint(rng), random_body(rng))
        for number, path in enumerate(paths, start=1)
    )
    return replace(scene, light=light or scene.light, vehicles=vehicles, rate=rate, frames=frames)


def lane_view(
    camera: PinholeCamera, *, near: float, far: float, width: float = 3.7
) -> LaneSettings:
    """Return the settings of a lane finder that shows the road from `near` to `far` metres.

    The camera is in the middle of a lane that is `width` metres wide; it sees the road at `near`.
    """
    side = width / 2
    corners = (-side, near), (side, near), (side, far), (-side, far)
    ends = np.array([[x, 0, z] for x, z in corners])
    straight = replace(camera, curvature=0.0)
    points = straight.project(ends) / (camera.width, camera.height)
    return LaneSettings.model_validate({"points": points.tolist(), "metres": (width, far - near)})


def as_planes(frame: Frame) -> Frame:
    """Return a frame in the form of a decoded video's."""
    return replace(frame, picture=Picture(Planes.of_image(frame.image, Coding())))


def follow(
    model: DetectorModel, settings: Settings, scene: Scene, clip: Iterable[Frame], *steps: Step
) -> Iterator[FrameResult]:
    """Find and follow the vehicles in the frames of a scene; yield the result of each."""
    camera, rate = scene.camera, scene.rate
    video = VideoInfo(Path("clip.mp4"), camera.width, camera.height, rate, 1 / rate)
    images, every = peek(clip)
    return build(Parts(model, steps=steps), settings, video, images).follow(every)


def shown_labels(results: Iterable[FrameResult]) -> SavedTracks:
    """Return the boxes that are shown."""
    return SavedTracks({result.frame.index: result.tracks for result in results if result.tracks})


def true_tracks(scene: Scene, index: int, *, min_width: float = 0.0) -> tuple[Track, ...]:
    """Return the true boxes of a frame as tracks, without those narrower than this, in pixels."""
    return tuple(
        Track(item.id, item.box, 0.9, "detected", "car")
        for item in true_boxes(scene, index)
        if item.box.width >= min_width
    )


def true_labels(scene: Scene, indices: Iterable[int]) -> SavedTracks:
    """Return the true boxes of frames; vehicles that do not count are ignore regions."""
    height = scene.camera.height
    frames = {
        index: [
            Track(item.id, item.box, 1.0, "detected", ignored=not must_be_found(item, height))
            for item in true_boxes(scene, index)
        ]
        for index in indices
    }
    return SavedTracks({index: tracks for index, tracks in frames.items() if tracks})


@dataclass(frozen=True, slots=True)
class TruePlace:
    """Where a vehicle stands on the road."""

    distance: float
    """Metres along the road from the camera to the vehicle's rear tyres."""
    lateral: float
    """Metres from the camera to the vehicle's middle, along the curve of the road; positive: right.
    """
    lane: int
    """Number of lane lines between the camera and the vehicle's middle; negative: to the left."""


def true_places(scene: Scene, index: int) -> dict[int, TruePlace]:
    """Return where the vehicles that exist at frame `index` are, seen or not, by id."""
    lines, places = [line.lateral for line in scene.road.lines], {}
    for place, vehicle in scene.nearest_first(scene.time(index)):
        to_right = sum(0 < line < place.lateral for line in lines)
        to_left = sum(place.lateral < line < 0 for line in lines)
        places[vehicle.id] = TruePlace(place.ahead + STANDS, place.lateral, to_right - to_left)
    return places
