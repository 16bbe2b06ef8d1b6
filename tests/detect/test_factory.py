"""Detectors by the name of their kind: those of vdet, and those that other packages register."""

import sys
from collections.abc import Iterator
from pathlib import Path
from textwrap import dedent

import pytest

from vdet.config.detector import DetectorSettings
from vdet.config.loading import load_settings
from vdet.config.schema import NetworkSettings, Settings, SvmSettings
from vdet.detect.factory import load_detector, model_file
from vdet.detect.onnx.detector import NetworkModel
from vdet.detect.svm.detector import SvmModel, shipped_model
from vdet.errors import ConfigError, ModelError


class TestLinearModel:
    def test_the_default_detector_is_the_shipped_network(self) -> None:
        assert isinstance(load_detector(Settings().detector), NetworkModel)
        shipped = model_file(Settings().detector)
        assert shipped is not None
        assert shipped.name == "net.onnx"

    @pytest.mark.parametrize(
        ("settings", "file", "kinds"),
        [
            (SvmSettings(model="their.onnx"), "their.onnx", "net, not svm"),
            (NetworkSettings(model="mine.npz"), "mine.npz", "svm, not net"),
        ],
    )
    def test_a_model_for_another_detector_than_that_of_the_settings_is_refused(
        self, settings: DetectorSettings, file: str, kinds: str
    ) -> None:
        with pytest.raises(ConfigError, match=f"^{file}: is for detector.kind: {kinds}; "):
            load_detector(settings)

    def test_a_model_file_is_taken_instead_of_the_shipped_one(self) -> None:
        seed = shipped_model(SvmSettings()).with_name("seed.npz")
        settings = SvmSettings(model=str(seed))
        assert model_file(settings) == seed
        assert isinstance(load_detector(settings), SvmModel)

    def test_a_missing_model_file_is_named(self, tmp_path: Path) -> None:
        with pytest.raises(ModelError, match=r"none\.npz: cannot be read"):
            load_detector(SvmSettings(model=str(tmp_path / "none.npz")))


def test_an_unknown_kind_is_refused_and_the_known_ones_are_named() -> None:
    for load in (load_detector, model_file):
        with pytest.raises(ConfigError, match=r"^sonar: unknown detector; known: svm"):
            load(DetectorSettings(kind="sonar"))


class TestAnotherPackage:
    """A detector that another installed package registers as an entry point."""

    MODULE = '''
        from typing import Literal

        from vdet.config.detector import DetectorSettings
        from vdet.boxes import Boxes
        from vdet.detect.factory import DetectorKind


        class CornerSettings(DetectorSettings):
            """A box in the corner of every frame."""

            kind: Literal["corner"] = "corner"
            side: int = 10


        class CornerDetector:
            def __init__(self, settings, model):
                self.settings, self.model = settings, model

            def for_video(self, width, height, images):
                return self

            def search(self, picture, index):
                return None

            def detect(self, candidates):
                return Boxes([[0, 0, self.settings.side, self.settings.side]], [1])

            def stage_pictures(self, image, detections):
                return {}


        KIND = DetectorKind(CornerSettings, CornerDetector)
    '''

    @pytest.fixture(autouse=True)
    def installed(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
        (tmp_path / "corner_detector.py").write_text(dedent(self.MODULE), "utf-8")
        info = tmp_path / "corner_detector-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(
            "Metadata-Version: 2.1\nName: corner-detector\nVersion: 1.0\n"
        )
        points = "[vdet.detectors]\ncorner = corner_detector:KIND\nbroken = corner_detector:NONE\n"
        (info / "entry_points.txt").write_text(points)
        monkeypatch.syspath_prepend(tmp_path)
        yield
        sys.modules.pop("corner_detector", None)

    def test_another_detector_is_found_by_the_name_of_its_kind(self) -> None:
        settings = load_settings((), ["detector={kind: corner, side: 20}"])
        detector = load_detector(settings.detector).for_video(100, 80, [])
        assert detector.detect(None).sides.tolist() == [[0, 0, 20, 20]]
        assert model_file(settings.detector) is None

    def test_a_detector_that_cannot_be_loaded_is_named(self) -> None:
        with pytest.raises(ConfigError, match=r"^broken: corner_detector:NONE cannot be loaded"):
            load_detector(DetectorSettings(kind="broken"))
