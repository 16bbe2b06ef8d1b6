"""`vdet train-net` before the training: what it refuses. `tests/learn/net` has the rest."""

import sys
from pathlib import Path

import pytest

from conftest import Run


def test_without_torch_the_message_says_how_to_install_it(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "vdet.learn.net.training", raising=False)
    monkeypatch.setitem(sys.modules, "torch", None)
    result = run("train-net", tmp_path, "-o", tmp_path / "a.onnx")
    assert result.code == 1
    advice = 'pip install torch, or vdet with its extra "train"'
    assert result.err == f"vdet: torch is not installed; {advice}\n"
