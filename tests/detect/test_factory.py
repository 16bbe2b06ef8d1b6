"""Detectors by the name of their kind: those of vdet, and those that other packages register."""

import pytest

from vdet.config.kinds import DetectorSettings
from vdet.config.schema import NetworkSettings, Settings, SvmSettings
from vdet.detect.detectors import load_detector, model_file
from vdet.detect.onnx.detector import NetworkModel
from vdet.detect.svm.detector import SvmModel, shipped_model
from vdet.errors import ConfigError


def test_the_default_detector_is_the_shipped_network() -> None:
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
    settings: DetectorSettings, file: str, kinds: str
) -> None:
    with pytest.raises(ConfigError, match=f"^{file}: is for detector.kind: {kinds}; "):
        load_detector(settings)


def test_a_model_file_is_taken_instead_of_the_shipped_one() -> None:
    seed = shipped_model(SvmSettings()).with_name("seed.npz")
    settings = SvmSettings(model=str(seed))
    assert model_file(settings) == seed
    assert isinstance(load_detector(settings), SvmModel)


def test_an_unknown_kind_is_refused_and_the_known_ones_are_named() -> None:
    for load in (load_detector, model_file):
        with pytest.raises(ConfigError, match=r"^sonar: unknown detector; known: net, svm"):
            load(DetectorSettings(kind="sonar"))
