"""A network that does not end is stopped; the limits of memory are in `hostile`."""

from pathlib import Path

import numpy as np
import pytest

from detect.onnx.graphs import write_endless
from vdet.detect.onnx.session import Session
from vdet.errors import ModelError


def test_a_network_that_does_not_end_is_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("vdet.detect.onnx.session.MAX_SECONDS", 1)
    session = Session(write_endless(tmp_path / "net.onnx"))
    picture = np.zeros((1, 3, 64, 64), np.float32)
    with pytest.raises(ModelError, match=r"net\.onnx: .* it took more than 1 s$"):
        session.run({"images": picture})
    assert capfd.readouterr().err == ""
