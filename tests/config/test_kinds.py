"""Sections of which there are several kinds: which one is chosen, and which keys it has."""

import sys
from pathlib import Path

import pytest

from vdet.config.kinds import RulesTrackerSettings
from vdet.config.loading import load_settings, render_settings
from vdet.config.schema import MotionTrackerSettings, Settings
from vdet.errors import ConfigError


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "my.yaml"


def load(path: Path, text: str, *assignments: str) -> Settings:
    path.write_text(text, encoding="utf-8")
    return load_settings([path], assignments)


def refusal(path: Path, text: str, *assignments: str) -> str:
    """Return the line of the error, without the file's folder."""
    with pytest.raises(ConfigError) as error:
        load(path, text, *assignments)
    (line,) = str(error.value).replace(f"{path.parent}/", "").split("\n")
    return line


@pytest.mark.parametrize(
    ("text", "assignments", "tracker"),
    [
        (
            "{kind: rules, history: 12}",
            ("tracker.young=3",),  # the old name
            RulesTrackerSettings(history=12, detections_to_keep=3),
        ),
        ("{kind: rules, history: 12}", ("tracker.kind=rules",), RulesTrackerSettings(history=12)),
        (
            "{kind: rules, history: 12}",  # another kind starts from its own defaults
            ("tracker.kind=motion", "tracker.decay=0.5"),
            MotionTrackerSettings(decay=0.5),
        ),
        ("{}", ("tracker.kind=rules", "tracker.history=5"), RulesTrackerSettings(history=5)),
        ("{}", ("tracker.history=5", "tracker.kind=rules"), RulesTrackerSettings(history=5)),
        ("{}", ("tracker={history: 5, kind: rules}",), RulesTrackerSettings(history=5)),
        ("", ("tracker={kind: motion, history: 5}", "tracker.kind=rules"),
         RulesTrackerSettings(history=5)),
    ],
)  # fmt: skip
def test_a_later_layer_changes_a_kind_or_chooses_another(
    path: Path, text: str, assignments: tuple[str, ...], tracker: object
) -> None:
    settings = load(path, f"output: {{crf: 30}}\ntracker: {text}", *assignments)
    assert settings.tracker == tracker
    assert settings.output.crf == 30


NOT_OF_MOTION = "unknown setting of tracker.kind: motion; known settings: kind, look_ahead, "


@pytest.mark.parametrize(
    ("text", "assignments", "message"),
    [
        ("tracker:\n  max_misses: 3\n", (), f"my.yaml:2:3: tracker.max_misses: {NOT_OF_MOTION}"),
        (
            "tracker: {kind: rules, decay: 0.3, history: 3}",
            (),
            "my.yaml:1:24: tracker.decay: unknown setting of tracker.kind: rules; known ",
        ),
        (
            "tracker: {kind: rules}",
            ("tracker.kind=motion", "tracker.history=3"),
            f"assignments: tracker.history: {NOT_OF_MOTION}",
        ),
        ("tracker: {kind: best}", (), "my.yaml:1:1: tracker: best: unknown tracker; known: mot"),
        ("tracker: {kind: [1]}", (), "my.yaml:1:1: tracker: [1]: unknown tracker; known: motion"),
        ("tracker: rules", (), "my.yaml:1:1: tracker: must be a section, key: value (got 'rule"),
    ],
)
def test_a_kind_that_is_not_known_and_a_key_of_another_kind_are_refused(
    path: Path, text: str, assignments: tuple[str, ...], message: str
) -> None:
    assert refusal(path, text, *assignments).startswith(message)


FAKE = '''
from typing import Literal
from pydantic import Field
from vdet.config.schema import DetectorSettings, Section
from vdet.config.kinds import DetectorKind

class PartSettings(Section):
    """A part of it."""
    size: int = Field(3, ge=1, description="how large it is")

class FakeSettings(DetectorSettings):
    """A detector of another package."""
    kind: Literal["fake"] = Field("fake", description="fake: finds nothing")
    level: int = Field(7, ge=0, le=255, description="how red a vehicle is")
    parts: tuple[PartSettings, ...] = Field((), description="its parts")
    by_name: dict[str, PartSettings] = Field({}, description="more parts")

FAKE = DetectorKind(FakeSettings, load=lambda settings, model: None)
'''
POINTS = """\
[vdet.detectors]
fake = fake_vdet:FAKE
broken = fake_vdet:NOTHING
missing = no_such_module_anywhere:X
"""


@pytest.fixture
def _fake_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Install a package with detectors, as an installer would, for this test."""
    folder = tmp_path / "site"
    info = folder / "fake_vdet-1.0.dist-info"
    info.mkdir(parents=True)
    (folder / "fake_vdet.py").write_text(FAKE)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: fake-vdet\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(POINTS)
    monkeypatch.syspath_prepend(folder)
    monkeypatch.delitem(sys.modules, "fake_vdet", raising=False)


@pytest.mark.usefixtures("_fake_package")
class TestOtherPackages:
    def test_settings_of_another_package_are_read_printed_and_read_back(self, path: Path) -> None:
        text = "detector: {kind: fake, parts: [{size: 5}], by_name: {a: {size: 6}}}"
        settings = load(path, text, "detector.level=9")
        assert type(settings.detector).__name__ == "FakeSettings"
        own = {"level": 9, "parts": ({"size": 5},), "by_name": {"a": {"size": 6}}}
        assert settings.detector.model_dump(include=set(own)) == own
        printed = render_settings(settings)
        assert "  # its parts\n  # Each item is a part of it.\n  #   size: how large" in printed
        assert "# A detector of another package.\ndetector:\n  # fake: finds nothing\n" in printed
        assert "  # how red a vehicle is\n  level: 9\n" in printed
        assert load(path, printed) == settings

    @pytest.mark.parametrize(
        ("text", "words"),
        [
            ("levl: 3", "levl: unknown setting of detector.kind: fake; did you mean level?"),
            ("parts: [{siz: 3}]", "detector.parts[0].siz: unknown setting; did you mean size?"),
            ("by_name: {a: {siz: 3}}", "by_name.a.siz: unknown setting; did you mean size?"),
            ("level: 300", "detector.level: must be less than or equal to 255 (got 300)"),
        ],
    )
    def test_its_mistakes_are_explained(self, path: Path, text: str, words: str) -> None:
        assert refusal(path, f"detector: {{kind: fake, {text}}}").endswith(words)

    @pytest.mark.parametrize(
        ("assignment", "words"),
        [
            ("level=9", r"\.level: unknown setting of detector\.kind: net; known settings: .*"),
            ("kind=best", ": best: .* known: net, svm, broken, fake, missing$"),
            ("kind=broken", r": broken: fake_vdet:NOTHING cannot be loaded \(AttributeError: .*"),
            ("kind=missing", r": missing: no_such.* cannot be loaded \(ModuleNotFoundError: .*"),
        ],
    )
    def test_all_kinds_and_their_keys_are_known_and_a_broken_package_is_named(
        self, assignment: str, words: str
    ) -> None:
        with pytest.raises(ConfigError, match=f"^assignments: detector{words}"):
            load_settings((), [f"detector.{assignment}"])
