"""`vdet config`."""

from pathlib import Path

import yaml

from conftest import Run

CONFIGS = Path(__file__).parents[2] / "configs"


def test_prints_the_built_in_settings_as_commented_yaml(run: Run) -> None:
    result = run("config")
    assert result.code == 0
    assert result.out == (CONFIGS / "default.yaml").read_text(encoding="utf-8")
    assert yaml.safe_load(result.out)["detector"]["kind"] == "net"


def test_a_file_and_then_assignments_change_them(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "my.yaml"
    file.write_text(
        "detector: {kind: svm, heat: {frames: 3, threshold: 2}}\ntracker: {look_ahead: 0.8}\n"
    )
    usual = yaml.safe_load(run("config", "-c", "svm").out)
    printed = yaml.safe_load(run("config", "-c", file, "--set", "detector.heat.threshold=5").out)
    heat = usual["detector"]["heat"] | {"frames": 3, "threshold": 5.0}
    assert printed == usual | {"detector": usual["detector"] | {"heat": heat}}
