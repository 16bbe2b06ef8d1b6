"""Detectors by the name of their kind: those of vdet, and those that other packages register."""

import sys
from collections.abc import Iterator
from pathlib import Path
from textwrap import dedent

import numpy as np
import pytest

from vdet.config.detector import DetectorSettings, FeatureSettings
from vdet.config.loading import load_settings
from vdet.config.schema import NetworkSettings, Settings, SvmSettings
from vdet.detect.factory import load_detector, model_file, trained_on
from vdet.detect.onnx.detector import NetworkModel
from vdet.detect.protocol import stage_pictures_of
from vdet.detect.svm.detector import SvmModel
from vdet.detect.svm.kind import shipped_model
from vdet.detect.svm.model import load_model
from vdet.errors import ConfigError, ModelError
from vdet.media import Picture

OTHER = FeatureSettings(patch=48)


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

    @pytest.mark.parametrize("name", ["svm", "seed"])
    def test_the_shipped_model_is_the_one_with_the_features_of_the_settings(
        self, name: str
    ) -> None:
        models = Path(shipped_model(SvmSettings())).parent
        features = load_model(models / f"{name}.npz").features
        settings = SvmSettings(features=features)
        assert model_file(settings) == models / f"{name}.npz"
        assert isinstance(load_detector(settings), SvmModel)

    def test_features_that_no_shipped_model_has_are_refused_with_advice(self) -> None:
        settings = SvmSettings(features=OTHER)
        for load in (load_detector, model_file):
            with pytest.raises(ModelError, match=r"no shipped model .* pass --model, or train one"):
                load(settings)

    def test_a_model_file_is_taken_instead_of_the_shipped_one(self) -> None:
        seed = shipped_model(SvmSettings()).with_name("seed.npz")
        settings = SvmSettings(model=str(seed))
        assert model_file(settings) == seed
        assert isinstance(load_detector(settings), SvmModel)

    def test_a_model_brings_its_features_where_the_settings_leave_the_default(self) -> None:
        seed = shipped_model(SvmSettings()).with_name("seed.npz")
        image = np.zeros((720, 1280, 3), np.uint8)
        model = load_detector(SvmSettings(model=str(seed)))
        detector = model.for_video(1280, 720, [image])
        sheet = stage_pictures_of(detector)(
            image, detector.detect(detector.search(Picture(image), None))
        )
        assert list(sheet) == ["windows", "hits", "heat"]

    def test_features_asked_for_must_be_those_of_the_model(self) -> None:
        default = shipped_model(SvmSettings())
        with pytest.raises(ModelError, match="was trained with other features"):
            load_detector(SvmSettings(features=OTHER, model=str(default)))

    def test_the_names_of_the_data_that_the_shipped_models_have_seen_are_known(self) -> None:
        names = trained_on(SvmSettings())
        assert {"KITTI_extracted", "GTI_Far", "mined_project_video"} <= set(names)
        assert {"idd", "project_video.mp4"} <= set(trained_on(NetworkSettings()))

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
