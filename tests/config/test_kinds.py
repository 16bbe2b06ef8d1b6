"""Sections of which there are several kinds: which one is chosen, and which keys it has."""

import pickle
import sys
from pathlib import Path

import pytest

from vdet.config.loading import load_settings
from vdet.config.rendering import render
from vdet.config.schema import MotionTrackerSettings, Settings
from vdet.config.tracker import RulesTrackerSettings
from vdet.errors import ConfigError

RULES = "--set: tracker.history: belongs to tracker.kind: rules, and has no effect with motion"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "my.yaml"


def load(path: Path, text: str, *assignments: str) -> Settings:
    path.write_text(text, encoding="utf-8")
    return load_settings([path], assignments)


def refusal(path: Path, text: str, *assignments: str) -> list[str]:
    """Return the lines of the error, without the file's folder."""
    with pytest.raises(ConfigError) as error:
        load(path, text, *assignments)
    return str(error.value).replace(f"{path.parent}/", "").split("\n")


class TestLayers:
    def test_assignments_change_the_kind_that_the_file_chose(self, path: Path) -> None:
        tracker = load(path, "tracker: {kind: rules, history: 12}", "tracker.young=3").tracker
        assert tracker == RulesTrackerSettings(history=12, young=3)

    def test_to_choose_the_same_kind_again_changes_nothing(self, path: Path) -> None:
        text = "tracker: {kind: rules, history: 12}"
        assert load(path, text, "tracker.kind=rules") == load(path, text)

    def test_another_kind_starts_from_its_own_defaults(self, path: Path) -> None:
        text = "tracker: {kind: rules, history: 12}\noutput: {crf: 30}"
        settings = load(path, text, "tracker.kind=motion", "tracker.confirm_seconds=0.5")
        assert settings.tracker == MotionTrackerSettings(confirm_seconds=0.5)
        assert settings.output.crf == 30

    @pytest.mark.parametrize("printed", ["motion", "rules"])
    @pytest.mark.parametrize("chosen", ["motion", "rules"])
    def test_a_kind_may_be_chosen_over_printed_settings(
        self, path: Path, printed: str, chosen: str
    ) -> None:
        text = render(load_settings((), [f"tracker.kind={printed}"]))
        assert load(path, text, f"tracker.kind={chosen}") == load_settings(
            (), [f"tracker.kind={chosen}"]
        )

    @pytest.mark.parametrize(
        "assignments",
        [
            ("tracker.kind=rules", "tracker.history=5"),
            ("tracker.history=5", "tracker.kind=rules"),
            ("tracker={history: 5, kind: rules}",),
            ("tracker={kind: motion, history: 5}", "tracker.kind=rules"),
        ],
    )
    def test_assignments_are_one_layer_in_any_order(self, assignments: tuple[str, ...]) -> None:
        assert load_settings((), assignments).tracker == RulesTrackerSettings(history=5)

    def test_settings_can_be_sent_to_another_process(self) -> None:
        settings = load_settings((), ["tracker.kind=rules", "tracker.history=5"])
        assert pickle.loads(pickle.dumps(settings)) == settings
        assert hash(settings.tracker) == hash(RulesTrackerSettings(history=5))


class TestRefused:
    def test_a_key_of_another_kind_is_refused_with_what_it_belongs_to(self, path: Path) -> None:
        (line,) = refusal(path, "tracker:\n  near: 3\n")
        words = "belongs to tracker.kind: rules, and has no effect with motion"
        assert line == f"my.yaml:2:3: tracker.near: {words}"
        (line,) = refusal(path, "tracker: {kind: rules, confirm_seconds: 0.3, history: 3}")
        words = "belongs to tracker.kind: motion, and has no effect with rules"
        assert line == f"my.yaml:1:24: tracker.confirm_seconds: {words}"

    def test_a_key_of_another_kind_in_an_assignment_is_refused(self, path: Path) -> None:
        assert refusal(path, "tracker: {kind: motion}", "tracker.history=3") == [RULES]
        assert refusal(path, "tracker: {kind: rules}", "tracker.kind=motion",
                       "tracker.history=3") == [RULES]  # fmt: skip

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("tracker: {kind: best}", "my.yaml:1:11: tracker.kind: best: unknown tracker; "),
            ("detector:\n  kind: yolo", "my.yaml:2:3: detector.kind: yolo: unknown detector; "),
            (
                "tracker: {kind: [1]}",
                "my.yaml:1:11: tracker.kind: must be motion or rules (got [1])",
            ),
            (
                "tracker: {kind: }",
                "my.yaml:1:11: tracker.kind: must be motion or rules (got None)",
            ),
            ("tracker: rules", "my.yaml:1:1: tracker: must be a section, key: value (got 'rule"),
        ],
    )
    def test_a_kind_that_is_not_known(self, path: Path, text: str, message: str) -> None:
        (line,) = refusal(path, text)
        assert line.startswith(message)


FAKE = '''
from typing import Literal
from pydantic import Field
from vdet.config.schema import DetectorSettings, Section
from vdet.detect.factory import DetectorKind

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
NAMELESS = DetectorKind(DetectorSettings, load=lambda settings, model: None)
'''
POINTS = """\
[vdet.detectors]
fake = fake_vdet:FAKE
broken = fake_vdet:NOTHING
missing = no_such_module_anywhere:X
nameless = fake_vdet:NAMELESS
odd = fake_vdet:__name__
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
    def test_settings_of_another_package_are_read_and_checked(self, path: Path) -> None:
        detector = load(path, "detector: {kind: fake, parts: [{size: 5}]}", "detector.level=9")
        assert type(detector.detector).__name__ == "FakeSettings"
        assert detector.detector.model_dump() == {
            "kind": "fake",
            "model": None,
            "searches_per_second": None,
            "stride": None,
            "foot": 0.0,
            "level": 9,
            "parts": ({"size": 5},),
            "by_name": {},
        }
        assert refusal(path, "detector: {kind: fake, level: 300}") == [
            "my.yaml:1:24: detector.level: must be less than or equal to 255 (got 300)"
        ]

    @pytest.mark.parametrize(
        ("text", "words"),
        [
            ("levl: 3", "detector.levl: unknown setting; did you mean level?"),
            ("parts: [{siz: 3}]", "detector.parts[0].siz: unknown setting; did you mean size?"),
            (
                "by_name: {a: {siz: 3}}",
                "detector.by_name.a.siz: unknown setting; did you mean size?",
            ),
            (
                "heat: {frames: 3}",
                "detector.heat: belongs to detector.kind: svm, and has no effect with fake",
            ),
        ],
    )
    def test_its_mistakes_are_explained(self, path: Path, text: str, words: str) -> None:
        (line,) = refusal(path, f"detector: {{kind: fake, {text}}}")
        assert line.endswith(words)

    def test_its_keys_are_known_to_belong_to_it(self) -> None:
        with pytest.raises(
            ConfigError, match=r"detector\.level: belongs to detector\.kind: fake, .* with net$"
        ):
            load_settings((), ["detector.level=9"])

    def test_its_settings_are_printed_with_their_comments_and_read_back(self, path: Path) -> None:
        parts = ["detector.parts=[{size: 4}]", "detector.by_name={a: {size: 5}}"]
        settings = load_settings((), ["detector.kind=fake", *parts])
        text = render(settings)
        assert "  # its parts\n  # Each item is a part of it.\n  #   size: how large" in text
        assert "# A detector of another package.\ndetector:\n  # fake: finds nothing\n" in text
        assert "  # how red a vehicle is\n  level: 7\n" in text
        assert load(path, text) == settings

    def test_all_names_are_known_those_of_vdet_first(self) -> None:
        with pytest.raises(
            ConfigError, match=r"known: svm, net, broken, fake, missing, nameless, odd$"
        ):
            load_settings((), ["detector.kind=best"])

    @pytest.mark.parametrize(
        ("kind", "words"),
        [
            ("broken", r"broken: fake_vdet:NOTHING cannot be loaded \(AttributeError: .*"),
            ("missing", r"missing: no_such.* cannot be loaded \(ModuleNotFoundError: .*"),
            ("nameless", r'nameless: has no settings of kind = "nameless"; repair'),
            ("odd", r'odd: has no settings of kind = "odd"; repair'),
        ],
    )
    def test_a_package_that_is_broken_is_named(self, kind: str, words: str) -> None:
        with pytest.raises(ConfigError, match=rf"^--set: detector\.kind: {words}"):
            load_settings((), [f"detector.kind={kind}"])
