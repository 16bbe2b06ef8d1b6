"""Networks of other tools: recognized without a setting, and their boxes are right."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from conftest import Run
from detect.onnx.graphs import (
    Form,
    RedBox,
    final,
    ultralytics,
    write_graph,
    write_network,
    write_with_weights_elsewhere,
)
from vdet.boxes import Boxes, Image
from vdet.config.schema import NetworkSettings
from vdet.detect.onnx.detector import NetworkModel
from vdet.detect.onnx.network import COCO, Session, cell_centers, recognize, vdet_cells
from vdet.errors import ModelError
from vdet.media import Picture
from writing import write_image

SIZE = 128, 64
FRAME = 256, 256
"""Frames are square, inputs are not: letterboxes leave grey at the sides."""

BOX = RedBox(x=64, y=32, width=16, height=8, class_id=2)
ULTRALYTICS = {"task": "detect", "names": str(dict(enumerate(COCO))), "imgsz": "[64, 128]"}


def frame_with_red(x: int, y: int) -> Image:
    """Return a grey frame with a red square around a point."""
    image = np.full((FRAME[1], FRAME[0], 3), 60, np.uint8)
    image[y - 8 : y + 8, x - 8 : x + 8] = 0, 0, 255
    return image


def detect(path: Path, image: Image, **settings: object) -> Boxes:
    model = NetworkModel(NetworkSettings.model_validate(settings), path)
    detector = model.for_video(image.shape[1], image.shape[0], [image])
    return detector.detect(detector.search(Picture(image), 0))


@pytest.mark.parametrize(
    ("form", "metadata", "name"),
    [
        (ultralytics(SIZE, BOX, 80), ULTRALYTICS, "Ultralytics v8 or later"),
        (ultralytics(SIZE, BOX, 80), None, "Ultralytics v8 or later"),
        (final(BOX), ULTRALYTICS, "boxes after suppression"),
        (final(BOX, rows=100), None, "boxes after suppression"),
    ],
    ids=["v8", "v8 bare", "end to end", "end to end bare"],
)
def test_a_centred_letterbox_in_rgb(
    form: Form, metadata: Mapping[str, str] | None, name: str, tmp_path: Path
) -> None:
    path = write_network(tmp_path / "net.onnx", form, SIZE, (64, 32), metadata=metadata)
    # The frame of 256 × 256 is shrunk to 64 × 64, and lies 32 pixels from the left.
    found = detect(path, frame_with_red(128, 128))
    assert found.sides == pytest.approx(np.array([[96, 112, 160, 144]]), abs=0.01)
    assert found.scores == pytest.approx([1.0], abs=0.01)
    assert found.class_names == ["car"]
    assert len(detect(path, frame_with_red(64, 64))) == 1  # the dark grey of 60 has 0.24
    assert detect(path, frame_with_red(64, 64)).scores == pytest.approx([60 / 255], abs=0.01)
    assert recognize(Session(path)).name == name


@pytest.mark.parametrize("make", [final, partial(ultralytics, SIZE, classes=80)])
def test_boxes_as_fractions_of_the_input_are_refused(
    make: Callable[..., Form], tmp_path: Path
) -> None:
    form = make(box=RedBox(x=0.5, y=0.5, width=0.25, height=0.25, class_id=2))
    path = write_network(tmp_path / "net.onnx", form, SIZE, (64, 32), metadata=None)
    with pytest.raises(ModelError, match=r"its boxes are fractions of the input, not pixels"):
        detect(path, frame_with_red(128, 128))


@pytest.mark.parametrize("form", [final(BOX), ultralytics(SIZE, BOX, 80)])
@pytest.mark.parametrize("row", [0, 4])
def test_outputs_that_are_not_numbers_are_refused(form: Form, row: int, tmp_path: Path) -> None:
    table = form.table.copy()
    table[(row, 7) if len(table) == 84 else (2, row)] = math.nan
    path = write_network(tmp_path / "net.onnx", replace(form, table=table), SIZE, (64, 32))
    with pytest.raises(ModelError, match=r"net\.onnx: its output has numbers that are not fin"):
        detect(path, frame_with_red(128, 128))


def test_a_batch_of_several_pictures_is_refused(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = write_network(tmp_path / "net.onnx", final(BOX), SIZE, (64, 32), batch=4)
    with pytest.raises(ModelError, match=r"its input is \[4, 3, 64, 128\], not \[1, 3, height"):
        recognize(Session(path))
    assert capfd.readouterr().err == ""


def test_how_likely_each_class_is_goes_to_the_tracker(tmp_path: Path) -> None:
    names = ["car", "van", "truck", "person"]
    form = ultralytics(SIZE, RedBox(64, 32, 16, 8, 2), 4)
    form.table[4:, 7] = 0.4, 0.2, 0.0, 0.4
    path = write_network(tmp_path / "net.onnx", form, SIZE, (64, 32))
    found = detect(path, frame_with_red(128, 128), class_names=names, classes=["truck", "car"])
    assert found.class_names == ["truck"]
    assert found.data["class_scores"] == pytest.approx(np.array([[0.5, 0.3]]), abs=0.01)
    path = write_network(tmp_path / "rows.onnx", final(BOX), SIZE, (64, 32))
    assert not detect(path, frame_with_red(128, 128)).data  # only the best class is known


@pytest.mark.parametrize(
    ("name", "classes", "is_found"),
    [
        ("car", ["car"], True),
        ("bus", ["car"], False),
        ("bus", ["bus", "car"], True),
        ("person", ["car", "bus", "truck", "motorcycle", "vehicle"], False),
        ("person", ["person"], True),
    ],
)
def test_only_the_classes_that_are_asked_for_count(
    name: str, classes: list[str], is_found: bool, tmp_path: Path
) -> None:
    box = RedBox(64, 32, 16, 8, COCO.index(name))
    path = write_network(tmp_path / "net.onnx", final(box), SIZE, (64, 32))
    found = detect(path, frame_with_red(128, 128), classes=classes)
    assert found.class_names == [name] * is_found


def test_names_can_be_given_and_one_class_without_a_name_is_of_vehicles(tmp_path: Path) -> None:
    nameless = ultralytics(SIZE, RedBox(64, 32, 16, 8), 1)
    path = write_network(tmp_path / "one.onnx", nameless, SIZE, (64, 32))
    assert detect(path, frame_with_red(128, 128)).class_names == ["vehicle"]
    form = ultralytics(SIZE, RedBox(64, 32, 16, 8, 1), 2)
    path = write_network(tmp_path / "net.onnx", form, SIZE, (64, 32))
    with pytest.raises(ModelError, match=r"has 2 classes and 0 names; set detector\.class_names"):
        detect(path, frame_with_red(128, 128))
    found = detect(path, frame_with_red(128, 128), class_names=["tree", "bus"])
    assert found.class_names == ["bus"]
    with pytest.raises(ModelError, match=r"has 2 classes and 1 names"):
        detect(path, frame_with_red(128, 128), class_names=["bus"])


def test_classes_that_are_not_used_are_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    form = ultralytics(SIZE, RedBox(64, 32, 16, 8, 1), 4)
    names = {"names": str(["car", "trailer", "person", "traffic light"])}
    path = write_network(tmp_path / "net.onnx", form, SIZE, (64, 32), metadata=ULTRALYTICS | names)
    assert detect(path, frame_with_red(128, 128)).class_names == []
    text = f"{path}: not reported: trailer; if vehicles, set detector.classes"
    assert caplog.messages == [text]
    assert detect(path, frame_with_red(128, 128), classes=["trailer"]).class_names == ["trailer"]
    assert caplog.messages == [text]


@pytest.mark.parametrize(
    ("class_id", "words"),
    [
        (0, "its highest class is 0; COCO has 0, a person, to 79; set detector.class_names"),
        (90, "its highest class is 90; COCO has 0, a person, to 79; set detector.class_names"),
        (COCO.index("car"), ""),
    ],
)
def test_a_network_without_names_may_have_other_classes_than_coco(
    run: Run, tmp_path: Path, class_id: int, words: str
) -> None:
    form = final(RedBox(64, 32, 16, 8, class_id))
    path = write_network(tmp_path / "net.onnx", form, SIZE, (64, 32))
    write_image(tmp_path / "in.png", frame_with_red(128, 128))
    result = run("detect-image", tmp_path / "in.png", "--model", path, code=0)
    assert words in result.err
    assert bool(words) == ("the network has no names" in result.err)
    named = ("--set", f"detector.class_names={['car'] * 91}")
    assert run("detect-image", tmp_path / "in.png", "--model", path, *named, code=0).err == ""


def test_a_network_without_a_wanted_class_is_refused(tmp_path: Path) -> None:
    form = ultralytics(SIZE, RedBox(64, 32, 16, 8), 1)
    metadata = {**ULTRALYTICS, "names": "{0: 'face'}"}
    path = write_network(tmp_path / "net.onnx", form, SIZE, (64, 32), metadata=metadata)
    with pytest.raises(ModelError, match=r"has none of detector\.classes, only face"):
        detect(path, frame_with_red(128, 128))


@pytest.mark.parametrize(
    ("table", "metadata", "seen"),
    [
        (
            np.zeros((300, 84)),
            None,
            r"its output is \(1, 300, 84\), not \(1, 4 \+ classes, 168\) or \(1, n, 6\); see docs",
        ),
        (np.zeros((84, 168)), {**ULTRALYTICS, "task": "segment"}, "its task is segment"),
        (np.zeros((84, 168)), {**ULTRALYTICS, "names": "{0:"}, "its metadata cannot be read"),
        (np.zeros((7, 168)), ULTRALYTICS, r"has 3 classes and 80 names"),
    ],
)
def test_what_is_not_known_is_refused_with_what_was_seen(
    table: npt.NDArray[np.float64], metadata: Mapping[str, str] | None, seen: str, tmp_path: Path
) -> None:
    form = Form(table.astype(np.float32), 0, 0)
    path = write_network(tmp_path / "net.onnx", form, SIZE, (0, 0), metadata=metadata)
    with pytest.raises(ModelError, match=seen):
        detect(path, frame_with_red(128, 128))


@pytest.mark.parametrize(
    ("inputs", "seen"),
    [
        ("float[1, 3, 64, 64] one, int64[1, 3, 64, 64] other", "it has 2 inputs, not one"),
        ("uint8[1, 3, 64, 64] one", r"its input is a tensor\(uint8\), not a tensor\(float\)"),
    ],
)
def test_other_inputs_are_refused(inputs: str, seen: str, tmp_path: Path) -> None:
    graph = (
        f"detector ({inputs}) => (float[1, 3, 64, 64] output0) {{ output0 = Cast <to=1> (one) }}"
    )
    path = write_graph(tmp_path / "net.onnx", graph)
    with pytest.raises(ModelError, match=rf"has an unknown form: {seen}; see docs"):
        recognize(Session(path))


def test_the_score_of_a_box_is_calibrated_by_the_class_it_is_named() -> None:
    table = np.zeros((1, 21, 7), np.float32)  # 16 + 4 + 1 cells of two classes
    table[..., 0], table[0, 3, 6] = 0.5, 1.0
    calibration = np.array([[1, 0], [2, -3]], np.float32)
    found = vdet_cells(table, 0.01, cells=cell_centers(32, 32), calibration=calibration)
    assert found[:, 5].tolist() == [0, 0, 0, 1, *[0] * 17]
    expected = [1 / (1 + math.exp(-(1 * 0.5 + 0))), 1 / (1 + math.exp(-(2 * 0.5 - 3)))]
    assert found[[0, 3], 4].tolist() == pytest.approx(expected, abs=1e-6)


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
