"""`vdet config`."""

from pathlib import Path

import pytest
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


def test_what_is_printed_can_be_given_back(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "printed.yaml"
    file.write_text(run("config", "--set", "train.svm.C=1e-3").out, encoding="utf-8")
    assert run("config", "-c", file).out == file.read_text(encoding="utf-8")


def test_all_mistakes_are_named_at_once(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "my.yaml"
    windows = "  search:\n    windows:\n      - {size: 64, overlap: 1.2}\n"
    file.write_text(f"detector:\n  kind: svm\n  heat:\n    frmes: 3\n{windows}")
    result = run("config", "-c", file, "--set", "tracker.confirm_seconds=soon")
    assert result.code == 1
    lines = result.err.splitlines()
    assert f"vdet: {file}:4:5: detector.heat.frmes: unknown setting; did you mean frames?" in lines
    assert any(f"{file}:7:20: detector.search.windows[0].overlap: " in line for line in lines)
    assert any("--set: tracker.confirm_seconds: must be a valid number" in line for line in lines)
    assert all(line.startswith("vdet: ") for line in lines)


@pytest.mark.parametrize("bad", ["history", "=3", "tracker..history=3"])
def test_an_assignment_needs_a_key_and_a_value(run: Run, bad: str) -> None:
    result = run("config", "--set", bad)
    assert result.code == 1
    assert "expected KEY=VALUE" in result.err
