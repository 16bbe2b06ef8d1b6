"""What is drawn on the frames of a video, and on still pictures, as the section `draw` says."""

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from red_cars import CAR, HEIGHT, WIDTH, road
from run.red_runs import VIDEO, result_of
from vdet.boxes import Box, Image
from vdet.config.scene import LensSettings
from vdet.config.schema import DrawSettings, LaneSettings, Settings
from vdet.draw import color_of, draw_box
from vdet.lanes.road import Lane, Road, RoadFinder
from vdet.media import Picture, VideoInfo
from vdet.media.frame import Coding, Planes
from vdet.run.sinks.drawn import Overlay
from vdet.run.steps import FrameResult
from vdet.track.track import State, Track

LENS = LensSettings(
    size=(WIDTH, HEIGHT),
    matrix=((240, 0, 160), (0, 240, 120), (0, 0, 1)),
    distortion=(-0.35, 0.1, 0.0, 0.0, 0.0),
)
LANE = Lane(
    curvature=0.0,
    radius=None,
    offset=0.0,
    width=3.7,
    left=np.array([[40.0, 220.0], [140.0, 140.0]]),
    right=np.array([[280.0, 220.0], [180.0, 140.0]]),
)


def overlay_with(*, video: VideoInfo | None = VIDEO, **settings: Any) -> Overlay:
    return Overlay(Settings(draw=DrawSettings(**settings)), video)


def drawn_on(result: FrameResult, *, video: VideoInfo | None = VIDEO, **settings: Any) -> Image:
    """Return what is drawn of a single frame under these settings of `draw`."""
    return shown(overlay_with(video=video, **settings), result)


def shown(overlay: Overlay, result: FrameResult) -> Image:
    """Return what is drawn of the next frame, whose picture is BGR."""
    surface = overlay.draw(result)
    assert not isinstance(surface, Planes)
    return surface


def road_seen(camera: LensSettings | None) -> Road:
    finder = RoadFinder(camera, LaneSettings(), WIDTH, HEIGHT)
    return finder.update(finder.observe(Picture(road(CAR))))


@pytest.mark.parametrize(
    ("text", "options"),
    [
        ("1", {}),
        ("0.90", {"video": None, "trails": 2.0}),  # a still picture has no ids or trails
        ("car 1", {"label": ("class", "id")}),
        ("0.90", {"label": ("score",)}),
        ("24 m 0.90", {"label": ("distance", "score")}),  # in this order
    ],
)
@pytest.mark.parametrize("camera", [None, LENS], ids=["without lanes", "with lanes"])
@pytest.mark.parametrize("state", ["detected", "predicted"])
def test_a_vehicle_is_drawn_where_it_is_with_its_label_and_dashed_if_it_is_lost(
    state: State, camera: LensSettings | None, text: str, options: dict[str, Any]
) -> None:
    track = Track(1, CAR, 0.9, state, "car" if "car" in text else None, distance=23.6)
    result = result_of(track, found=road_seen(camera) if camera else None)
    expected = road(CAR)
    draw_box(expected, CAR, color_of(1), text, dashed=state == "predicted")
    np.testing.assert_array_equal(drawn_on(result, **options), expected)
    edge = expected[CAR.pixels[3] - 1, CAR.pixels[0] : CAR.pixels[2]]
    drawn = (edge == color_of(1)).all(axis=1).mean()
    assert drawn == 1 if state == "detected" else 0.2 < drawn < 0.8


@pytest.mark.parametrize("settings", [{}, {"trails": 1.0}])
def test_a_frame_that_came_as_planes_stays_planes_and_looks_the_same(
    settings: dict[str, Any],
) -> None:
    planes = Planes.of_image(road(CAR), Coding("bt709"))
    as_image = result_of(CAR, image=planes.to_image())
    as_planes = replace(as_image, frame=replace(as_image.frame, picture=Picture(planes)))
    before = planes.copy()
    drawn = overlay_with(**settings).draw(as_planes)
    assert isinstance(drawn, Planes)
    assert drawn.is_writable, "it may be encoded"
    for layer, old, new in zip(planes.layers, before.layers, drawn.layers, strict=True):
        np.testing.assert_array_equal(layer, old)
        assert (new != old).any()
    expected = drawn_on(as_image, **settings)
    assert np.abs(drawn.to_image().astype(int) - expected).mean() < 1.5


def white(width: int, height: int) -> Image:
    return np.full((height, width, 3), 255, np.uint8)


# Boxes


def test_colors_can_be_those_of_the_classes() -> None:
    boxes = [Box.sized(10 + 60 * n, 100, 50, 50) for n in range(5)]
    names = ["car", "car", "truck", "tram", None]
    tracks = [
        Track(n, box, 0.9, state="detected", class_name=name)
        for n, (box, name) in enumerate(zip(boxes, names, strict=True), start=1)
    ]
    image = drawn_on(result_of(*tracks, image=white(320, 240) // 2), colors="class")
    colors = [tuple(image[149, box.pixels[0] + 25].tolist()) for box in boxes]
    assert colors[0] == colors[1]
    assert len(set(colors)) == 4


# Trails


def passing(count: int, rate: int = 25) -> Iterator[FrameResult]:
    """Give frames in which a vehicle moves to the right, 4 pixels a frame."""
    for number in range(count):
        box = Box.sized(10 + 4 * number, 100, 40, 30)
        time = Fraction(number, rate)
        yield result_of(box, image=white(320, 240), index=number, time=time)


def trail_columns(seconds: float) -> list[int]:
    """Return the columns in which the trail of `passing` is drawn in the last frame."""
    overlay = overlay_with(trails=seconds, label=())
    *_, last = (shown(overlay, result) for result in passing(50))
    rows, columns = np.nonzero((last[130:] != 255).any(axis=2))  # below the box
    assert rows.max() <= 3, "it follows the feet"
    return sorted(set(columns.tolist()))


def test_a_trail_is_the_path_of_the_feet_in_the_last_seconds() -> None:
    end = 10 + 4 * 49 + 20
    columns = trail_columns(1.0)
    assert abs(max(columns) - end) <= 2
    assert abs(min(columns) - (end - 100)) <= 4
    assert columns == list(range(min(columns), max(columns) + 1)), "without a gap"
    assert abs(min(trail_columns(0.4)) - (end - 40)) <= 4
