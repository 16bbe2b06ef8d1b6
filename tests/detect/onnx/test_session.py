"""A network that does not end is stopped; the limits of memory are in `hostile`."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from detect.onnx.graphs import write_endless, write_slow, write_with_weights_elsewhere
from vdet.detect.onnx.session import Session
from vdet.errors import ModelError


@pytest.mark.parametrize(
    ("write", "side"), [(write_endless, 64), (write_slow, 700)], ids=["a loop", "one operation"]
)
def test_a_network_that_does_not_end_is_given_up(
    write: Callable[[Path], Path],
    side: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("vdet.detect.onnx.session.MAX_SECONDS", 1)
    session = Session(write(tmp_path / "net.onnx"))
    picture = np.zeros((1, 3, side, side), np.float32)
    with pytest.raises(ModelError, match=r"net\.onnx: .* it took more than 1 s$"):
        session.run(picture)
    assert capfd.readouterr().err == ""


def test_weights_in_other_files_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    weights = tmp_path / "weights.bin"
    weights.write_bytes(bytes(16))
    for location in ("weights.bin", str(weights), f"../{tmp_path.name}/weights.bin"):
        path = write_with_weights_elsewhere(tmp_path / "net.onnx", location)
        with pytest.raises(
            ModelError, match=r"net\.onnx: .* in other files; export it as one file"
        ):
            Session(path)
    assert capfd.readouterr().err == ""
