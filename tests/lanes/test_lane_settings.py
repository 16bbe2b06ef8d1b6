"""Settings of the lane finder: limits, descriptions, effects."""

from collections.abc import Callable, Sequence
from typing import Any

import pytest
from pydantic import ValidationError

from vdet.config.lanes import LaneSettings, TopViewSettings
from vdet.config.section import scale_lengths
from vdet.lanes.lane import lane_record
from vdet.lanes.road import LaneRequest, RoadFinder
from vdet.media.images import Image
from vdet.synthetic.camera import PinholeCamera
from vdet.synthetic.render import Renderer
from vdet.synthetic.scene import Line, Scene

WIDTH, HEIGHT = 640, 360
CHANGES = {
    "view.top": 0.60,
    "view.bottom": 0.90,
    "view.top_left": 0.44,
    "view.top_right": 0.56,
    "view.bottom_left": 0.15,
    "view.bottom_right": 0.85,
    "view.lane_width": 3.5,
    "view.length": 30.0,
    "view.margin": 0.0,
    "view.across": 20.0,
    "view.along": 5.0,
    "mask.line_width": 0.4,
    "mask.reach": 0.1,
    "mask.lightness": 0.9,
    "mask.least_lightness": 60.0,
    "mask.yellow": 1.0,
    "search.base": 3.0,
    "search.window": 36.0,
    "search.margin": 0.1,
    "search.fine_margin": 0.05,
    "check.width": 0.001,
    "check.parallel": 0.001,
    "check.radius": 1000.0,
    "check.marking": 30.0,
    "check.scatter": 0.001,
    "check.jump": 0.05,
    "track.memory": 0.0,
    "track.curve_memory": 0.0,
    "track.carry": 1,
    "track.straight": 300.0,
}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"top": 0.95}, "bottom must be below top"),
        ({"top_left": 0.6}, "closer together at top"),
        ({"bottom_left": 0.46, "bottom_right": 0.54}, "closer together at top"),
        ({"length": float("nan")}, "finite"),
        ({"length": 500, "along": 50, "across": 200}, "not give more than 4000000 pixels"),
    ],
)
def test_a_top_view_that_is_not_a_trapezoid_is_refused(
    changes: dict[str, float], message: str
) -> None:
    with pytest.raises(ValidationError, match=message):
        TopViewSettings(**(TopViewSettings().model_dump() | changes))


def test_every_setting_has_a_description() -> None:
    for section in (LaneSettings(), *LaneSettings().__dict__.values()):
        assert type(section).__doc__
        for name, field in type(section).model_fields.items():
            assert field.description or name in LaneSettings.model_fields


def test_no_setting_depends_on_the_frame_size() -> None:
    assert scale_lengths(LaneSettings(), 2.0) == LaneSettings()


@pytest.fixture(scope="module")
def settings(settings_for: Callable[[PinholeCamera], LaneSettings]) -> LaneSettings:
    return settings_for(PinholeCamera.dashboard(WIDTH, HEIGHT))


@pytest.fixture(scope="module")
def images(make_road: Callable[..., Scene]) -> list[Image]:
    """A bend whose lines move sideways by 0.1 m; then the right line ends."""
    roads = [(Line(-1.85), Line(1.85, dash=3.0)), (Line(-1.75), Line(1.95)), (Line(-1.75),)]
    scenes = [
        make_road(curvature=1 / 400, lines=lines, size=(WIDTH, HEIGHT), frames=3) for lines in roads
    ]
    return [Renderer(scene).image(index) for scene in scenes for index in range(scene.frames)]


def lanes_in(images: Sequence[Image], settings: LaneSettings) -> list[dict[str, Any] | None]:
    finder = RoadFinder(LaneRequest(), settings, WIDTH, HEIGHT)
    return [lane_record(finder.update(finder.observe(image)).lane) for image in images]


@pytest.fixture(scope="module")
def lanes(images: list[Image], settings: LaneSettings) -> list[dict[str, Any] | None]:
    return lanes_in(images, settings)


def test_the_lane_is_found_in_all_images(lanes: list[dict[str, Any] | None]) -> None:
    assert all(lanes)


def test_the_effect_of_every_setting_is_tested() -> None:
    sections = LaneSettings().model_dump(exclude={"place"}).items()  # see test_position.py
    assert [f"{name}.{key}" for name, keys in sections for key in keys] == list(CHANGES)


@pytest.mark.parametrize("key", CHANGES)
def test_every_setting_changes_the_lane(
    key: str, images: list[Image], settings: LaneSettings, lanes: list[dict[str, Any] | None]
) -> None:
    section, name = key.split(".")
    values = settings.model_dump()
    values[section][name] = CHANGES[key]
    assert lanes_in(images, LaneSettings(**values)) != lanes
