"""Places in the frame as settings: what is refused before any work, and how they are scaled."""

from pathlib import Path
from typing import Any

import pytest
import yaml
from pydantic import ValidationError

from vdet.config.loading import load_settings, render_settings
from vdet.config.scene import LineSettings, TrafficSettings
from vdet.config.schema import Settings
from vdet.errors import ConfigError

SQUARE = [[0.1, 0.1], [0.3, 0.1], [0.3, 0.3], [0.1, 0.3]]


def region(points: Any, **others: Any) -> Settings:
    return Settings.model_validate({"regions": [{"name": "road", "points": points} | others]})


def line(**others: Any) -> TrafficSettings:
    values = {"name": "line", "start": [0, 0.5], "end": [1, 0.5]} | others
    return TrafficSettings.model_validate({"lines": [values]})


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (SQUARE[:2], "has 2 corners; a polygon needs at least 3"),
        ([*SQUARE[:2], SQUARE[0]], "has 2 corners; a polygon needs at least 3"),
        ([[0.1, 0.1], [1.3, 0.1], [0.3, 0.3]], "a point is outside the frame; points are in pix"),
        ([[0.1, -0.1], [0.9, 0.1], [0.3, 0.3]], "a point is outside the frame"),
        ([[0.1, 0.1, 5], [0.3, 0.1], [0.3, 0.3]], "at most 2 items"),
    ],
)
def test_polygons_that_make_no_sense_are_refused(points: Any, message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        region(points)
    with pytest.raises(ValidationError, match=message):
        TrafficSettings.model_validate({"zones": [{"name": "z", "points": points}]})


@pytest.mark.parametrize("shape", [{"points": SQUARE, "mask": "a.png"}, {"points": None}])
def test_a_region_has_a_polygon_or_a_mask(shape: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match="road: needs either points or mask"):
        region(**shape)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"left": "up", "right": "up"}, "left and right must have different names"),
        ({"end": [1, 1.01]}, "a point is outside the frame"),
        ({"start": [1, 0.5]}, "line: is shorter than 1 % of the frame"),
        ({"end": [0.009, 0.509]}, "line: is shorter than 1 % of the frame"),
        ({"name": ""}, "at least 1 character"),
    ],
)
def test_lines_that_make_no_sense_are_refused(values: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        line(**values)


def test_a_name_can_be_given_once() -> None:
    twice = [{"name": "a", "points": SQUARE}] * 2
    for section in ({"regions": twice}, {"traffic": {"zones": twice}}):
        with pytest.raises(ValidationError, match="a: the name is used twice"):
            Settings.model_validate(section)


def test_names_give_each_column_of_a_table_once() -> None:
    with pytest.raises(ValidationError, match=r"\(none\): is reserved"):
        line(name="(none)")
    lines = [line(name="a: b", left="c").lines[0], line(name="a", left="b: c").lines[0]]
    with pytest.raises(ValidationError, match="a: b: c: would be two columns"):
        TrafficSettings(lines=tuple(lines))


def test_a_closed_polygon_is_the_same_as_an_unclosed_one() -> None:
    assert region([*SQUARE, SQUARE[0]]) == region(SQUARE)


@pytest.mark.parametrize(
    ("text", "seconds"), [(None, None), ("30s", 30), ("15min", 900), ("15 min", 900), ("1h", 3600)]
)
def test_an_interval_has_a_unit(text: str | None, seconds: int | None) -> None:
    assert TrafficSettings(interval=text).seconds == seconds


@pytest.mark.parametrize(
    ("text", "message"),
    [("7min", "does not divide a day"), ("15:00", "is not an interval"), ("0s", "try 30s")],
)
def test_an_interval_divides_a_day(text: str, message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        TrafficSettings(interval=text)


def test_frames_of_another_shape_than_the_camera_are_refused() -> None:
    gate = LineSettings(name="gate", size=(1280, 720), start=(0, 360), end=(1280, 360))
    for size in ((640, 360), (1920, 1088)):
        assert gate.for_frames(*size).size == size
    with pytest.raises(ConfigError, match="1280×720, whose aspect ratio differs from 640"):
        gate.for_frames(640, 480)


class TestFiles:
    def test_points_are_pixels_of_the_size_in_their_file(self, tmp_path: Path) -> None:
        (tmp_path / "gate.yaml").write_text(
            "camera: {size: [1280, 720], ground: [{pixel: [320, 180], metres: [5, 7]}]}\n"
            "traffic: {lines: [{name: a, start: [0, 360], end: [1280, 360]}],"
            " zones: [{name: z, points: [[0, 0], [640, 0], [640, 360]]}]}\n"
            "regions: [{name: r, points: [[0, 0], [1280, 0], [1280, 720]]}]\n"
        )
        (tmp_path / "more.yaml").write_text(
            "traffic: {lines: [{name: b, start: [0, 0.5], end: [1, 1]}]}"
        )
        (tmp_path / "bush.yaml").write_text(
            "camera: {size: [640, 360]}\n"
            "regions: [{name: b, points: [[0, 0], [640, 0], [640, 360]]}]\n"
        )
        settings = load_settings([tmp_path / f"{name}.yaml" for name in ("gate", "more", "bush")])
        point, [line], [zone], [region] = (
            settings.camera.ground[0], settings.traffic.lines, settings.traffic.zones,
            settings.regions,
        )  # fmt: skip
        assert (point.size, point.pixel) == ((1280, 720), (320, 180))
        assert (line.size, line.name, line.end) == ((1, 1), "b", (1, 1))
        assert (zone.size, zone.points[2]) == ((1280, 720), (640, 360))
        assert (region.size, region.name) == ((640, 360), "b")
        assert point.for_frames(640, 360).pixel == (160, 90)
        assert line.for_frames(640, 360).start == (0, 180)
        assert zone.for_frames(1280, 720) == zone
        (tmp_path / "printed.yaml").write_text(printed := render_settings(settings))
        assert load_settings([tmp_path / "printed.yaml"]) == settings
        assert yaml.safe_load(printed)["regions"][0].keys() == {"name", "points", "kind"}

    def test_paths_are_relative_to_their_file(self, tmp_path: Path) -> None:
        (tmp_path / "gate.yaml").write_text(
            "regions: [{name: r, mask: mask.png}]\ndetector: {model: a.npz}\n"
            "labels: {roles: {mask: ignored, model: other}}"
        )
        settings = load_settings([tmp_path / "gate.yaml"], ["detector.model=b.npz"])
        assert settings.regions[0].mask == str(tmp_path / "mask.png")
        assert (settings.detector.kind, settings.detector.model) == ("svm", "b.npz")
        assert settings.labels.roles == {"mask": "ignored", "model": "other"}
        assert load_settings([tmp_path / "gate.yaml"]).detector.model == str(tmp_path / "a.npz")
