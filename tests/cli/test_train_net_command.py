"""`vdet train-net` before the training: what it refuses. `tests/learn/net` has the rest."""

import sys
from pathlib import Path

import pytest

from conftest import Run


def test_without_data_it_is_wrong_usage(run: Run, tmp_path: Path) -> None:
    result = run("train-net", "-o", tmp_path / "a.onnx")
    assert result.code == 2
    assert "nothing to learn from; pass DATA or --video" in result.err


def test_the_output_is_named_as_a_network(run: Run, tmp_path: Path) -> None:
    output = tmp_path / "a.pt"
    result = run("train-net", tmp_path, "-o", output)
    assert result.code == 1
    assert result.err == f"vdet: {output}: networks must end in .onnx\n"


def test_without_torch_the_message_says_how_to_install_it(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "vdet.learn.net.training", raising=False)
    monkeypatch.setitem(sys.modules, "torch", None)
    result = run("train-net", tmp_path, "-o", tmp_path / "a.onnx")
    assert result.code == 1
    advice = 'pip install torch, or vdet with its extra "train"'
    assert result.err == f"vdet: torch is not installed; {advice}\n"
