"""`vdet config`."""

from pathlib import Path

import yaml

from conftest import Run

CONFIGS = Path(__file__).parents[2] / "configs"


def test_prints_the_built_in_settings_as_commented_yaml(run: Run) -> None:
    result = run("config", code=0)
    assert result.out == (CONFIGS / "default.yaml").read_text(encoding="utf-8")
    assert yaml.safe_load(result.out)["detector"]["kind"] == "net"
