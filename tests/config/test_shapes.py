"""Places in the frame as settings: what is refused before any work, and how they are scaled."""

from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from vdet.config.loading import load_settings
from vdet.config.places import RegionsSettings, TrafficSettings
from vdet.errors import ConfigError

SQUARE = [[100, 100], [300, 100], [300, 300], [100, 300]]
HD = [1280, 720]


def regions(points: Any, **others: Any) -> RegionsSettings:
    return RegionsSettings.model_validate(
        {"size": HD, "polygons": [{"name": "road", "points": points}]} | others
    )


def line(**others: Any) -> TrafficSettings:
    values = {"name": "line", "start": [0, 400], "end": [1280, 400]} | others
    return TrafficSettings.model_validate({"size": HD, "lines": [values]})


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (SQUARE[:2], "has 2 corners; give three or more"),
        ([*SQUARE[:2], SQUARE[0]], "has 2 corners; give three or more"),
        ([SQUARE[0], SQUARE[2], SQUARE[1], SQUARE[3]], "crosses or touches itself"),
        ([[100, 100], [300, 300], [500, 500]], "crosses or touches itself"),
        ([[100, 100], [1300, 100], [300, 300]], r"\[1300, 100\] lies outside 1280×72"),
        ([[100, -1], [900, 100], [300, 300]], r"\[100, -1\] lies outside"),
        ([[100, 100, 5], [300, 100], [300, 300]], "at most 2 items"),
    ],
)
def test_polygons_that_make_no_sense_are_refused(points: Any, message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        regions(points)
    with pytest.raises(ValidationError, match=message):
        TrafficSettings.model_validate({"size": HD, "zones": [{"name": "z", "points": points}]})


def test_shares_beyond_1_are_asked_for_a_size() -> None:
    with pytest.raises(ValidationError, match=r"outside 1×1; shares are 0 to 1, and for pixels g"):
        regions(SQUARE, size=None)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"start": [1280, 400]}, "start and end are one point"),
        ({"left": "up", "right": "up"}, "left and right have one name"),
        ({"end": [1280, 721]}, "lies outside"),
        ({"name": ""}, "at least 1 character"),
    ],
)
def test_lines_that_make_no_sense_are_refused(values: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        line(**values)


def test_a_name_can_be_given_once() -> None:
    twice = [{"name": "a", "points": SQUARE}] * 2
    with pytest.raises(ValidationError, match="a: this name is given twice"):
        RegionsSettings.model_validate({"size": HD, "polygons": twice})


def test_a_closed_polygon_is_the_same_as_an_unclosed_one() -> None:
    assert regions([*SQUARE, SQUARE[0]]) == regions(SQUARE)


def test_pixels_are_scaled_to_frames_of_the_same_shape_and_refused_for_others() -> None:
    given = regions(SQUARE)
    assert given.scales(640, 360) == (0.5, 0.5)
    assert given.scales(1920, 1088) == pytest.approx((1.5, 1.511), abs=0.001)
    with pytest.raises(ConfigError, match="given for frames of 1280×720, which have another shape"):
        given.scales(640, 480)
    assert RegionsSettings().scales(640, 480) == (640, 480)


def test_a_size_has_two_sides() -> None:
    with pytest.raises(ValidationError, match=r"size\.1"):
        RegionsSettings.model_validate({"size": [1280]})


class TestFilesOfASection:
    def test_a_file_replaces_the_places_of_a_config_and_keeps_the_rest(
        self, tmp_path: Path
    ) -> None:
        config, lines = tmp_path / "my.yaml", tmp_path / "lines.yaml"
        config.write_text(
            "counts: {size: [9, 9], confirmed: 0.3, lines: [{name: a, start: [0, 0], end: [9, 9]}]}"
        )
        lines.write_text("zones: [{name: z, points: [[0, 0], [1, 0], [1, 1]]}]")
        counts = load_settings([config], ["traffic.drawn=true"], {"counts": lines}).counts
        assert (counts.size, counts.lines, traffic.confirmed, traffic.drawn) == (
            None,
            (),
            0.3,
            True,
        )
        assert [zone.name for zone in counts.zones] == ["z"]

    def test_a_mistake_has_its_place_in_the_file(self, tmp_path: Path) -> None:
        lines = tmp_path / "lines.yaml"
        lines.write_text("lines:\n  - {name: a, start: [0, 0], end: [1, 1], lefft: up}\n")
        with pytest.raises(ConfigError) as caught:
            load_settings((), (), {"counts": lines})
        assert str(caught.value) == (
            f"{lines}:2:43: counts.lines[0].lefft: is no setting; did you mean left?"
        )

    def test_a_picture_is_a_mask(self, tmp_path: Path) -> None:
        mask = tmp_path / "mask.PNG"
        assert load_settings((), (), {"regions": mask}).regions.mask == str(mask)
        assert load_settings((), (), {"regions": mask}).regions.polygons == ()
