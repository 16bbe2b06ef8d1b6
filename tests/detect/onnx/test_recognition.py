"""Networks of the usual tools: recognised without a setting, and their boxes are right."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from detect.onnx.graphs import (
    Form,
    RedBox,
    final,
    rt_detr_rows,
    ultralytics,
    write_network,
    write_rt_detr,
    yolox,
)
from vdet.boxes import Boxes, Image
from vdet.config.schema import NetworkSettings
from vdet.detect.onnx.detector import NetworkModel
from vdet.detect.onnx.layouts import cell_centers, our_cells
from vdet.detect.onnx.recognition import COCO, recognize
from vdet.detect.onnx.session import Session
from vdet.errors import ModelError
from vdet.media import Picture

SIZE = 128, 64
FRAME = 256, 256
"""Frames are square, inputs are not: letterboxes leave grey at the sides."""

BOX = RedBox(x=64, y=32, width=16, height=8, class_id=2)
CAR, BUS = COCO.index("car"), COCO.index("bus")
ULTRALYTICS = {
    "task": "detect",
    "names": str(dict(enumerate(COCO))),
    "imgsz": "[64, 128]",
    "stride": "32",
    "args": "{'nms': False}",
}
FINAL = {**ULTRALYTICS, "args": "{'nms': True}"}


def frame_with_red(x: int, y: int) -> Image:
    """Return a grey frame with a red square around a point."""
    image = np.full((FRAME[1], FRAME[0], 3), 60, np.uint8)
    image[y - 8 : y + 8, x - 8 : x + 8] = 0, 0, 255
    return image


def detect(path: Path, image: Image, **settings: object) -> Boxes:
    model = NetworkModel(path, NetworkSettings.model_validate(settings))
    detector = model.for_video(image.shape[1], image.shape[0], [image])
    return detector.detect(detector.search(Picture(image), 0))


def class_names(found: Boxes) -> list[str]:
    assert found.classes is not None
    return [found.names[number] for number in found.classes.tolist()]


@pytest.mark.parametrize(
    ("form", "metadata", "name"),
    [
        (ultralytics(SIZE, BOX, 80), ULTRALYTICS, "Ultralytics v8 or later"),
        (ultralytics(SIZE, BOX, 80), None, "Ultralytics v8 or later"),
        (final(BOX), FINAL, "boxes after suppression"),
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
    assert class_names(found) == ["car"]
    assert len(detect(path, frame_with_red(64, 64))) == 1  # the dark grey of 60 has 0.24
    assert detect(path, frame_with_red(64, 64)).scores == pytest.approx([60 / 255], abs=0.01)
    assert recognize(Session(path)).name == name


@pytest.mark.parametrize("raw", [True, False], ids=["raw", "decoded"])
@pytest.mark.parametrize(("classes", "name"), [(80, "car"), (1, "vehicle")])
def test_yolox_has_its_letterbox_at_the_top_left_in_bgr(
    raw: bool, classes: int, name: str, tmp_path: Path
) -> None:
    """With one class, its table looks like one of boxes after suppression."""
    form = yolox(SIZE, replace(BOX, class_id=min(2, classes - 1)), classes, raw=raw)
    path = write_network(tmp_path / "net.onnx", form, SIZE, (40, 32))
    found = detect(path, frame_with_red(160, 128))
    # 64 of the 128 columns are the frame: the part beyond it does not count.
    assert found.sides == pytest.approx(np.array([[224, 112, 256, 144]]), abs=0.01)
    assert found.scores == pytest.approx([1.0], abs=0.01)
    assert class_names(found) == [name]
    assert recognize(Session(path)).name == "YOLOX"


def test_rt_detr_stretches_the_frame(tmp_path: Path) -> None:
    path = write_rt_detr(tmp_path / "net.onnx", BOX, SIZE, (64, 32))
    found = detect(path, frame_with_red(128, 128))
    assert found.sides == pytest.approx(np.array([[112, 112, 144, 144]]), abs=0.01)
    assert found.scores == pytest.approx([1.0], abs=0.01)
    assert recognize(Session(path)).name == "RT-DETR"


@pytest.mark.parametrize("classes", [2, 80])
def test_rt_detr_of_ultralytics_has_rows_of_fractions(classes: int, tmp_path: Path) -> None:
    box = RedBox(x=64, y=32, width=16, height=8, class_id=1)
    names = ["car", "bus"] if classes == 2 else COCO
    metadata = {**ULTRALYTICS, "names": str(dict(enumerate(names)))}
    metadata["description"] = "Ultralytics RT-DETR-l model"
    form = rt_detr_rows(SIZE, box, classes)
    path = write_network(tmp_path / "net.onnx", form, SIZE, (64, 32), metadata=metadata)
    found = detect(path, frame_with_red(128, 128), classes=names)
    assert found.sides == pytest.approx(np.array([[112, 112, 144, 144]]), abs=0.01)
    assert class_names(found) == [names[1]]
    assert recognize(Session(path)).name == "RT-DETR of Ultralytics"


@pytest.mark.parametrize("make", [final, partial(ultralytics, SIZE, classes=80)])
def test_boxes_as_fractions_of_the_input_are_refused(
    make: Callable[..., Form], tmp_path: Path
) -> None:
    form = make(box=RedBox(x=0.5, y=0.5, width=0.25, height=0.25, class_id=2))
    path = write_network(tmp_path / "net.onnx", form, SIZE, (64, 32), metadata=None)
    with pytest.raises(ModelError, match=r"its boxes are fractions of the input, not pixels"):
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
    assert class_names(found) == ["truck"]
    assert found.data["class_scores"] == pytest.approx(np.array([[0.5, 0.3]]), abs=0.01)
    bare = detect(
        write_network(tmp_path / "rows.onnx", final(BOX), SIZE, (64, 32)), frame_with_red(128, 128)
    )
    assert not bare.data  # only the best class is known


def test_only_the_classes_that_are_asked_for_count(tmp_path: Path) -> None:
    image = frame_with_red(128, 128)
    for class_id, classes, expected in (
        (CAR, ["car"], ["car"]),
        (BUS, ["car"], []),
        (BUS, ["bus", "car"], ["bus"]),
        (COCO.index("person"), ["car", "bus", "truck", "motorcycle", "vehicle"], []),
        (COCO.index("person"), ["person"], ["person"]),
        (COCO.index("motorcycle"), ["car"], []),
        (COCO.index("motorcycle"), ["motorcycle"], ["motorcycle"]),
    ):
        box = RedBox(64, 32, 16, 8, class_id)
        path = write_network(tmp_path / "net.onnx", final(box), SIZE, (64, 32), metadata=FINAL)
        found = detect(path, image, classes=classes)
        assert class_names(found) == expected


def test_names_can_be_given_and_one_class_without_a_name_is_of_vehicles(tmp_path: Path) -> None:
    nameless = ultralytics(SIZE, RedBox(64, 32, 16, 8), 1)
    path = write_network(tmp_path / "one.onnx", nameless, SIZE, (64, 32))
    assert class_names(detect(path, frame_with_red(128, 128))) == ["vehicle"]
    form = ultralytics(SIZE, RedBox(64, 32, 16, 8, 1), 2)
    path = write_network(tmp_path / "net.onnx", form, SIZE, (64, 32))
    with pytest.raises(ModelError, match=r"does not name its 2 classes; set detector\.class_names"):
        detect(path, frame_with_red(128, 128))
    found = detect(path, frame_with_red(128, 128), class_names=["tree", "bus"])
    assert class_names(found) == ["bus"]
    with pytest.raises(ModelError, match=r"has 2 classes, not 1"):
        detect(path, frame_with_red(128, 128), class_names=["bus"])


def test_a_network_without_a_wanted_class_is_refused(tmp_path: Path) -> None:
    form = ultralytics(SIZE, RedBox(64, 32, 16, 8), 1)
    metadata = {**ULTRALYTICS, "names": "{0: 'face'}"}
    path = write_network(tmp_path / "net.onnx", form, SIZE, (64, 32), metadata=metadata)
    with pytest.raises(ModelError, match=r"knows none of detector\.classes, only face"):
        detect(path, frame_with_red(128, 128))


@pytest.mark.parametrize(
    ("table", "metadata", "seen"),
    [
        (np.zeros((10, 9)), None, r"for an input of 128×64 it gives \(1, 10, 9\)"),
        (np.zeros((84, 168)), {**ULTRALYTICS, "task": "segment"}, "its task is segment"),
        (np.zeros((84, 168)), {**ULTRALYTICS, "names": "{0:"}, "its metadata cannot be read"),
        (np.zeros((7, 168)), ULTRALYTICS, r"it gives \(1, 7, 168\)"),
    ],
)
def test_what_is_not_known_is_refused_with_what_was_seen(
    table: npt.NDArray[np.float64], metadata: Mapping[str, str] | None, seen: str, tmp_path: Path
) -> None:
    form = Form(table.astype(np.float32), 0, 0)
    path = write_network(tmp_path / "net.onnx", form, SIZE, (0, 0), metadata=metadata)
    with pytest.raises(ModelError, match=seen):
        detect(path, frame_with_red(128, 128))


def test_the_score_of_a_box_is_calibrated_by_the_class_it_is_named() -> None:
    table = np.zeros((1, 21, 7), np.float32)  # 16 + 4 + 1 cells of two classes
    table[..., 0], table[0, 3, 6] = 0.5, 1.0
    calibration = np.array([[1, 0], [2, -3]], np.float32)
    found = our_cells([table], 0.01, cells=cell_centers(32, 32), calibration=calibration)
    assert found.classes.tolist() == [0, 0, 0, 1, *[0] * 17]
    expected = [1 / (1 + math.exp(-(1 * 0.5 + 0))), 1 / (1 + math.exp(-(2 * 0.5 - 3)))]
    assert found.scores[[0, 3]].tolist() == pytest.approx(expected, abs=1e-6)
