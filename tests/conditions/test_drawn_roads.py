"""Findings on a drawn road that changes: the right one in time, and none without a change."""

from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest
from benchmarks.conditions import EXPECTED, SETTINGS, Road

from vdet import load_settings
from vdet.boxes import NO_BOXES
from vdet.conditions import visibility
from vdet.conditions.visibility import VisibilityWatch
from vdet.conditions.watch import Conditions, planes_of
from vdet.config.schema import Code, ConditionSettings, Settings
from vdet.lanes.road import Lane
from vdet.media import Picture
from vdet.media.frame import Coding, Planes
from vdet.track.track import Track


@pytest.fixture(scope="module")
def road() -> Road:
    return Road.drawn(1)


@pytest.mark.parametrize(("kind", "code"), EXPECTED.items())
def test_the_right_finding_is_there_in_time_and_can_be_ignored(
    road: Road, kind: str, code: Code | None
) -> None:
    conditions = road.watched(kind)
    findings = conditions.findings()
    assert road.is_right(kind, findings), findings
    ignoring = ConditionSettings(ignore=(code,) if code else ())
    conditions._settings = SETTINGS.model_copy(update={"conditions": ignoring})
    others = tuple(item for item in findings.items if item.code != code)
    assert conditions.findings() == replace(findings, items=others)


def test_drops_are_reported_while_they_are_on_the_lens() -> None:
    seen = (*np.log((105, 15, 0.5)),)
    sharp = *seen, -4.0, -4.4, -2.0, 0.55, 0.1, 0.8
    soft_everywhere = *seen, -4.8, -4.6, -0.9, 0.35, 0.5, 0.45
    watch = VisibilityWatch(is_shipped=True)
    for time in (np.arange(60) / 4).tolist():
        watch.add(time, np.array(soft_everywhere if 5 <= time < 10 else sharp), is_wet=False)
    (finding,) = watch.findings()
    assert (finding.code, finding.severity) == ("drops", "warning")
    assert finding.spans == ((5.0, 9.75),)
    assert "on the lens from 0:05 to 0:09" in finding.text


def found(settings: Settings, width: int = 640) -> list[str]:
    conditions = Conditions(settings, width)
    image = np.full((90, width, 3), 90, np.uint8)
    for number in range(10):
        conditions.add(number / 2, Picture(image), NO_BOXES, ())
    codes = (finding.code for finding in conditions.findings().items)
    return [code for code in codes if code != "nothing-found"]  # nothing moved


@pytest.mark.parametrize("apart", [6 / 30, 6 / 25, 6 / 24])
def test_every_search_of_an_empty_road_is_analysed(
    apart: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    measure = Mock(side_effect=visibility.measure)
    monkeypatch.setattr(visibility, "measure", measure)
    conditions, image = Conditions(SETTINGS, 640), np.full((90, 640, 3), 90, np.uint8)
    for number in range(50):
        conditions.add(number * apart, Picture(image), NO_BOXES, ())
    assert measure.call_count == 50


def test_what_the_settings_make_doubtful_is_said() -> None:
    lanes = load_settings((), ["lanes.enabled=true"])
    assert found(lanes) == ["lane-geometry"]
    assert found(Settings(), width=300) == ["small-frames"]
    assert found(SETTINGS) == []


@pytest.mark.parametrize(
    ("lanes", "distance", "codes"), [(1, 40.0, []), (1, None, ["lane"]), (0, None, ["lane"])]
)
def test_a_camera_that_is_described_has_metres_unless_there_is_no_lane_or_distance(
    lanes: int, distance: float | None, codes: list[str]
) -> None:
    conditions = Conditions(load_settings("project-camera", ["lanes.enabled=true"]), 640)
    lane, track = Mock(Lane), Mock(Track, distance=distance)
    for number in range(10):
        conditions.add_road(lane if number < lanes else None, [track])
    assert [finding.code for finding in conditions.findings().items] == codes


def test_a_plane_is_the_same_from_a_decoder_and_from_an_image() -> None:
    image = np.random.default_rng(1).integers(40, 200, (90, 160, 3), np.uint8)
    image = np.repeat(np.repeat(image, 4, axis=0), 4, axis=1)
    decoded, half = planes_of(Picture(Planes.of_image(image, Coding())))
    assert (decoded.shape, half.shape) == ((180, 320), (90, 160))
    np.testing.assert_allclose(decoded.astype(float), planes_of(Picture(image))[0], atol=3)
