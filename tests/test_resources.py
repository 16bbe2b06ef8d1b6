from pathlib import Path

import pytest

from vdet.config.loading import load_settings
from vdet.config.schema import Settings
from vdet.errors import ConfigError
from vdet.model import load_model
from vdet.resources import find_config, shipped_model


@pytest.fixture(autouse=True)
def _somewhere_else(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)


def test_the_seed_config_is_found_by_its_name() -> None:
    assert load_settings(find_config("seed")).settings == Settings()


def test_a_path_is_taken_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "my.yaml").touch()
    assert find_config("my.yaml") == Path("my.yaml")
    assert find_config(str(tmp_path / "my.yaml")) == tmp_path / "my.yaml"


def test_a_file_of_the_name_goes_before_the_shipped_config(tmp_path: Path) -> None:
    (tmp_path / "seed").touch()
    assert find_config("seed") == Path("seed")


@pytest.mark.parametrize("name", ["no", "seed.yaml", "../configs/seed"])
def test_an_unknown_name_names_the_shipped_configs(name: str) -> None:
    with pytest.raises(ConfigError, match=rf"^{name}: no such file; shipped configs are: .*seed"):
        find_config(name)


def test_the_shipped_model_has_the_features_of_the_seed_config() -> None:
    model = load_model(shipped_model(), Settings().features)
    assert model.weights.shape[1] == 4800
    assert "data_sha256" in model.provenance
