"""A network is one file."""

from pathlib import Path

import pytest

from detect.onnx.graphs import write_with_weights_elsewhere
from vdet.detect.onnx.network import Session
from vdet.errors import ModelError


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


def test_a_network_of_another_form_is_named_with_the_way_to_onnx(tmp_path: Path) -> None:
    (tmp_path / "net.xml").write_text("<net/>", encoding="utf-8")
    with pytest.raises(ModelError, match=r"net\.xml: is a file of OpenVINO; export the network as"):
        Session(tmp_path / "net.xml")
