"""The linear model under its name: which file is shipped, and which features it must have."""

from pathlib import Path

import pytest

from red_cars import red_finder
from vdet.config.kinds import FeatureSettings
from vdet.config.loading import find_config, load_settings
from vdet.config.schema import SvmSettings
from vdet.detect.detectors import load_detector, model_file
from vdet.detect.svm.detector import shipped_model
from vdet.detect.svm.model import load_model, save_model
from vdet.errors import ModelError

OTHER = FeatureSettings(patch=48)


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
        shipped_model(SvmSettings(features=OTHER))


def test_a_model_file_brings_its_own_features_but_not_others_than_are_asked_for(
    tmp_path: Path,
) -> None:
    path = str(tmp_path / "red.npz")
    save_model(red_finder(), Path(path))
    load_detector(SvmSettings(model=path))
    load_detector(SvmSettings(features=red_finder().features, model=path))
    with pytest.raises(ModelError, match=r"red\.npz: was .* other features: detector\.features=\{"):
        load_detector(SvmSettings(features=OTHER, model=path))
