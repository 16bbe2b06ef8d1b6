"""Detectors by the name of their kind: those of vdet, and those that other packages register."""

from pathlib import Path

import pytest

from red_cars import red_finder
from vdet.config.kinds import DetectorSettings, FeatureSettings
from vdet.config.loading import find_config, load_settings
from vdet.config.schema import NetworkSettings, Settings, SvmSettings
from vdet.detect.detectors import load_detector, model_file
from vdet.detect.onnx.detector import NetworkModel
from vdet.detect.svm.detector import SvmModel, shipped_model
from vdet.detect.svm.model import load_model, save_model
from vdet.errors import ConfigError, ModelError


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


@pytest.mark.parametrize("name", ["svm", "seed"])
def test_every_shipped_config_has_a_shipped_model(name: str) -> None:
    settings = load_settings([find_config(name)]).svm
    path = shipped_model(settings)
    assert path.stem == name
    assert model_file(settings) == path
    model = load_model(path, settings.features)
    assert model.weights.shape[1] == 4800
    assert "report" in model.provenance


def test_features_that_no_shipped_model_has_are_refused_with_advice() -> None:
    with pytest.raises(ModelError, match=r"no shipped model .* set detector.model, or train one"):
        shipped_model(SvmSettings(features=FeatureSettings(patch=48)))


def test_a_model_file_brings_its_own_features_but_not_others_than_are_asked_for(
    tmp_path: Path,
) -> None:
    path = str(tmp_path / "red.npz")
    save_model(red_finder(), Path(path))
    load_detector(SvmSettings(model=path))
    load_detector(SvmSettings(features=red_finder().features, model=path))
    with pytest.raises(ModelError, match=r"red\.npz: was .* other features: detector\.features=\{"):
        load_detector(SvmSettings(features=FeatureSettings(patch=48), model=path))
