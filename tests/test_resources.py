from pathlib import Path

import pytest

from vdet.config.loading import find_config, load_settings
from vdet.config.schema import FeatureSettings, Settings
from vdet.detect.svm.kind import shipped_model
from vdet.detect.svm.model import load_model
from vdet.errors import ConfigError, ModelError


@pytest.fixture(autouse=True)
def _somewhere_else(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)


def test_shipped_configs_are_found_by_their_names() -> None:
    assert load_settings(find_config("default")) == Settings()
    assert load_settings(find_config("seed")).features.patch == 64


def test_a_path_is_taken_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "my.yaml").touch()
    assert find_config("my.yaml") == Path("my.yaml")
    assert find_config(str(tmp_path / "my.yaml")) == tmp_path / "my.yaml"


def test_a_file_of_the_name_goes_before_the_shipped_config(tmp_path: Path) -> None:
    (tmp_path / "seed").touch()
    assert find_config("seed") == Path("seed")


@pytest.mark.parametrize("name", ["no", "seed.yaml", "../configs/seed"])
def test_an_unknown_name_names_the_shipped_configs(name: str) -> None:
    with pytest.raises(ConfigError) as error:
        find_config(name)
    assert str(error.value) == f"{name}: no such file; shipped configs are: default, seed"


@pytest.mark.parametrize(("name", "length"), [("default", 4800), ("seed", 4800)])
def test_every_shipped_config_has_a_shipped_model(name: str, length: int) -> None:
    features = load_settings(find_config(name)).features
    path = shipped_model(features)
    assert path.stem == name
    model = load_model(path, features)
    assert model.weights.shape[1] == length
    assert "data_sha256" in model.provenance


def test_features_that_no_shipped_model_has_are_refused_with_advice() -> None:
    with pytest.raises(ModelError, match=r"no shipped model .* give --model, or train one"):
        shipped_model(FeatureSettings(color_space="HSV"))
