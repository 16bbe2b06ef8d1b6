"""Findings on a drawn road that changes: the right one in time, and none without a change."""

import numpy as np
import pytest
from benchmarks.conditions import EXPECTED, SETTINGS, Changed, drawn_road

from vdet import load_settings
from vdet.boxes import NO_BOXES
from vdet.conditions.visibility import Sight, findings
from vdet.conditions.watch import Conditions, small_luma
from vdet.config.schema import ConditionSettings, Settings
from vdet.media import Picture
from vdet.media.frame import Coding, Planes


@pytest.fixture(scope="module")
def road() -> Changed:
    return drawn_road(1)


@pytest.mark.parametrize("kind", EXPECTED)
def test_the_right_finding_is_there_in_time(road: Changed, kind: str) -> None:
    assert road.is_right(kind), road.findings(kind)


def test_drops_are_reported_while_they_are_on_the_lens() -> None:
    sharp = Sight(100, 15, 0.5, (-4.0, -4.4, -2.0, 0.55), weak=0.1, sure=0.8)
    soft_everywhere = Sight(100, 15, 0.5, (-4.8, -4.6, -0.9, 0.35), weak=0.5, sure=0.45)
    times = [number / 4 for number in range(60)]
    sights = [soft_everywhere if 5 <= time < 10 else sharp for time in times]
    (finding,) = findings(times, sights, is_shipped=True)
    assert (finding.code, finding.severity) == ("drops", "warning")
    assert finding.spans == ((5.0, 9.75),)
    assert "on the lens from 0:05 to 0:09" in finding.text


def found(settings: Settings, width: int = 640, unknown: tuple[str, ...] = ()) -> list[str]:
    conditions = Conditions(settings, width, unknown)
    image = np.full((90, width, 3), 90, np.uint8)
    for number in range(10):
        conditions.add(number / 2, Picture(image), NO_BOXES, ())
    return [finding.code for finding in conditions.findings()]


def test_what_the_settings_make_doubtful_is_said() -> None:
    lanes = load_settings((), ["lanes.enabled=true"])
    assert found(lanes) == ["lane-geometry"]
    assert found(Settings(), unknown=("tram",)) == ["classes"]
    assert found(Settings(), width=300) == ["small-frames"]
    assert found(SETTINGS) == []


def test_a_camera_that_is_described_has_metres() -> None:
    described = load_settings("project-camera", ["lanes.enabled=true"])
    assert found(described) == []


def test_findings_are_left_out_by_their_codes() -> None:
    ignoring = ConditionSettings(ignore=("lane-geometry", "small-frames"))
    lanes = load_settings((), ["lanes.enabled=true"])
    assert found(lanes.model_copy(update={"conditions": ignoring}), width=300) == []


def test_a_plane_is_the_same_from_a_decoder_and_from_an_image() -> None:
    image = np.random.default_rng(1).integers(40, 200, (90, 160, 3), np.uint8)
    image = np.repeat(np.repeat(image, 4, axis=0), 4, axis=1)
    decoded = small_luma(Picture(Planes.of_image(image, Coding())))
    assert decoded.shape == (180, 320)
    np.testing.assert_allclose(decoded.astype(float), small_luma(Picture(image)), atol=3)
