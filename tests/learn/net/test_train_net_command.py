"""`vdet train-net`: from labelled pictures of each form to a network, and on after a stop."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from conftest import Run
from labels.writers import WRITERS, Boxed, Labelled, write_coco
from vdet.detect.onnx.detector import SHIPPED
from vdet.detect.onnx.network import Session, read_header

torch = pytest.importorskip(
    "torch", reason="torch is not installed; `make nettest` installs it and runs these tests"
)

QUICK = tuple(
    argument
    for value in ("steps=2", "batch=2", "size=[128,64]")
    for argument in ("--set", f"train.net.{value}")
)
CAR = Boxed("car", (20, 30, 60, 40))


def write_set(folder: Path, form: str = "COCO", *boxes: Boxed) -> Path:
    picture = Labelled(160, 96, boxes or (CAR,))
    WRITERS[form](folder, {"a": picture, "b": picture})
    return folder


@pytest.mark.parametrize("form", WRITERS)
def test_it_learns_from_pictures_labelled_in_each_form(run: Run, tmp_path: Path, form: str) -> None:
    folder, output = write_set(tmp_path / "my_set", form), tmp_path / "net.onnx"
    result = run("train-net", folder, "-o", output, *QUICK, code=0)
    first, *_, loss, written = result.out.splitlines()
    assert (first, written) == ("my_set: 2 images; 2 car", f"{output}: written")
    assert re.fullmatch(r"loss: \d+\.\d{3} at the start, \d+\.\d{3} at the end", loss)
    assert "finds nothing after 2 steps from random weights; set more" in result.err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["my_set", "net.onnx"]
    picture = next(folder.rglob("a.png"))
    run("detect-image", picture, "-c", "net", "--model", output, "--json", "-", code=0)


def test_a_network_that_is_there_is_kept_unless_it_may_be_replaced(
    run: Run, tmp_path: Path
) -> None:
    folder, output = write_set(tmp_path / "set"), tmp_path / "net.onnx"
    output.write_text("mine")
    refused = run("train-net", folder, "-o", output, *QUICK)
    assert refused.code == 1
    assert output.read_text() == "mine"
    run("train-net", folder, "-o", output, *QUICK, "--overwrite", code=0)
    assert output.stat().st_size > 100_000


def test_a_training_that_was_stopped_before_its_end_is_written_without_a_step(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    command = ("train-net", write_set(tmp_path / "set"), "-o", tmp_path / "net.onnx", *QUICK)
    with monkeypatch.context() as stopped:
        stopped.setattr("vdet.learn.net.training.export_network", stop)
        assert run(*command).code == 130
    assert sorted(path.name for path in tmp_path.iterdir()) == ["net.ckpt", "set"]
    with monkeypatch.context() as trained:
        trained.setattr("vdet.learn.net.training._Training.learn", stop)
        result = run(*command)
    assert result.code == 0, result.err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["net.onnx", "set"]


def provenance(network: Path) -> dict[str, Any]:
    header = read_header(Session(network))
    assert header is not None
    return dict(header.provenance)


def test_a_network_has_learnt_from_the_sets_of_its_base_too(run: Run, tmp_path: Path) -> None:
    base, output = tmp_path / "base.onnx", tmp_path / "net.onnx"
    run("train-net", write_set(tmp_path / "one"), "-o", base, *QUICK, code=0)
    command = ("train-net", write_set(tmp_path / "two"), "-o", output, *QUICK)
    run(*command, "--base", base, code=0)
    report = provenance(output)["report"], provenance(output)["base"]["report"]
    assert [item["sources"][0]["name"] for item in report] == ["two", "one"]
    result = run(*command, "--base", "default", "--overwrite", code=0)
    assert provenance(output)["base"] == provenance(SHIPPED)
    assert "finds nothing" not in result.err


def test_a_base_that_is_not_there_is_said_before_the_training(run: Run, tmp_path: Path) -> None:
    command = ("train-net", write_set(tmp_path / "set"), "-o", tmp_path / "net.onnx", *QUICK)
    result = run(*command, "--base", tmp_path / "base.onnx")
    assert result.code == 1
    assert "base.onnx: cannot be read: No such file" in result.err
    assert [path.name for path in tmp_path.iterdir()] == ["set"]


def test_it_says_what_becomes_of_each_label(run: Run, tmp_path: Path) -> None:
    pictures = tmp_path / "set"
    boxes = [Boxed(name, (20, 30, 60, 40)) for name in ("car", "bus", "ignore")]
    labels = write_coco(
        pictures, {"a": Labelled(160, 96, (*boxes, Boxed("car", (100, 30, 40, 40))))}
    )
    document = json.loads(labels.read_text(encoding="utf-8"))
    document["info"]["unlabelled_classes"] = ["cyclist", "dog"]
    document["categories"] += [{"id": 6, "name": "rickshaw"}, {"id": 7, "name": "person"}]
    document["annotations"] += [
        {"id": number, "image_id": 0, "category_id": number, "bbox": [90, 30, 30, 20]}
        for number in (5, 6, 7)
    ]
    labels.write_text(json.dumps(document), encoding="utf-8")
    classes = ("--set", 'train.net.classes=["car","bicycle","bus"]')
    result = run("train-net", pictures, "-o", tmp_path / "net.onnx", *QUICK, *classes, code=0)
    assert result.out.splitlines()[:2] == [
        "set: 1 image; 2 car, 1 bus, 1 vehicle",
        "  background, as their label is unknown: 1 cow",
    ]
    header = read_header(Session(tmp_path / "net.onnx"))
    assert header is not None
    assert header.classes == ("car", "bicycle", "bus")
    (source,) = header.provenance["report"]["sources"]
    assert (source["unlabelled"], source["ignored"]) == (["bicycle"], {"person": 1})
