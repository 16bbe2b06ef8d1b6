"""`docs/convert_network.py`: YOLOX and RT-DETR in a form that is read."""

import runpy
import sys
from pathlib import Path

import numpy as np
import onnx
import pytest
from docs.convert_network import converted
from onnx import parser

from vdet.boxes import Boxes, Float64Array
from vdet.config.schema import NetworkSettings
from vdet.detect.onnx.detector import NetworkModel
from vdet.media import Picture

SIDE = 64
CAR, TRUCK = 2, 7
"""Classes of COCO."""

# A car of 32 × 16 pixels in the middle; the second box has no class.
RT_DETR = """
<ir_version: 8, opset_import: ["" : 17]>
detr (float[1, 3, 64, 64] pixel_values)
=> (float[1, 2, 80] logits, float[1, 2, 4] pred_boxes)
<float[1, 2, 80] all_logits = {LOGITS},
 float[1, 2, 4] boxes = {0.5, 0.5, 0.5, 0.25, 0.1, 0.1, 0.1, 0.1},
 float none = {0}>
{
    mean = ReduceMean <keepdims = 0> (pixel_values)
    nothing = Mul (mean, none)
    logits = Add (all_logits, nothing)
    pred_boxes = Add (boxes, nothing)
}
"""
# The objectness is that of a cell, times the blue value of the image, 0 to 255.
YOLOX = """
<ir_version: 8, opset_import: ["" : 17]>
yolox (float[1, 3, 64, 64] images) => (float[1, 84, 85] output)
<float[1, 84, 85] shape = {SHAPE}, float[1, 84, 85] objectness = {OBJECTNESS},
 int64 first = {0}>
{
    channels = ReduceMean <axes = [2, 3], keepdims = 0> (images)
    blue = Gather <axis = 1> (channels, first)
    scaled = Mul (objectness, blue)
    output = Add (shape, scaled)
}
"""


def text(values: Float64Array) -> str:
    return "{" + ", ".join(f"{value:g}" for value in values.ravel()) + "}"


def detect(network: onnx.ModelProto, path: Path, color: tuple[int, int, int]) -> Boxes:
    onnx.save(converted(network), path)
    model = NetworkModel(NetworkSettings(), path).for_video(SIDE, SIDE, [])
    image = np.full((SIDE, SIDE, 3), color, np.uint8)
    return model.detect(model.search(Picture(image), 0))


def test_rt_detr(tmp_path: Path) -> None:
    logits = np.full((2, 80), -9.0)
    logits[0, CAR] = 2
    network = parser.parse_model(RT_DETR.replace("{LOGITS}", text(logits)))
    boxes = detect(network, tmp_path / "net.onnx", (0, 0, 0))
    assert boxes.class_names == ["car"]
    np.testing.assert_allclose(boxes.sides, [[16, 24, 48, 40]])
    assert boxes.scores.tolist() == pytest.approx([1 / (1 + np.exp(-2))])


def test_yolox(tmp_path: Path) -> None:
    shape, objectness = np.zeros((84, 85)), np.zeros((84, 85))
    shape[:, :2], shape[:, 2:4], shape[:, 5 + TRUCK] = 0.5, 1, 0.8
    objectness[10, 4] = 1 / 255  # of the cell in column 2 and row 1, 8 pixels wide
    content = YOLOX.replace("{SHAPE}", text(shape)).replace("{OBJECTNESS}", text(objectness))
    path = tmp_path / "net.onnx"
    boxes = detect(parser.parse_model(content), path, (255, 0, 0))
    half = 4 * np.e
    assert boxes.class_names == ["truck"]
    np.testing.assert_allclose(
        boxes.sides, [[20 - half, 12 - half, 20 + half, 12 + half]], atol=1e-4
    )
    assert boxes.scores.tolist() == pytest.approx([0.8])
    assert not len(detect(parser.parse_model(content), path, (0, 0, 255)))


def test_without_onnx_it_says_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "onnx", None)
    with pytest.raises(SystemExit, match="onnx is not installed; pip install onnx"):
        runpy.run_path("docs/convert_network.py")
