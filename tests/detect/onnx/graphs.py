"""Tiny ONNX files in the forms that the usual tools export; each gives boxes that a test chooses.

A box has the score of the red value (0 to 1) of one pixel of the input, so that a test sees which
pixel of the frame lies there, and whether the channels and their range are right.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import onnx
from onnx import TensorProto, helper, numpy_helper

Array = npt.NDArray[np.float32]

OPSET = helper.make_opsetid("", 17)
IR_VERSION = 8


@dataclass(frozen=True, slots=True)
class RedBox:
    """A box of the input: middle and size, pixels; it is as red as the pixel `(x, y)` there."""

    x: float
    y: float
    width: float
    height: float
    class_id: int = 0

    @property
    def corners(self) -> tuple[float, float, float, float]:
        return (
            self.x - self.width / 2,
            self.y - self.height / 2,
            self.x + self.width / 2,
            self.y + self.height / 2,
        )


def cells(width: int, height: int) -> list[tuple[int, int, int]]:
    """Return x, y and stride of all cells, as YOLOX and Ultralytics order them."""
    return [
        (x, y, stride)
        for stride in (8, 16, 32)
        for y in range(height // stride)
        for x in range(width // stride)
    ]


@dataclass(frozen=True, slots=True)
class Form:
    """Where the parts of a box lie in a table `(rows, columns)`, and where it finds red."""

    table: Array
    score_row: int
    score_column: int
    red_channel: int = 0
    red: float = 1.0


def ultralytics(size: tuple[int, int], box: RedBox, classes: int) -> Form:
    """v8 and v11: `(4 + classes, n)`."""
    table = np.zeros((4 + classes, len(cells(*size))), np.float32)
    table[:4, 7] = box.x, box.y, box.width, box.height
    return Form(table, 4 + box.class_id, 7)


def rt_detr_rows(size: tuple[int, int], box: RedBox, classes: int) -> Form:
    """RT-DETR of Ultralytics: `(300, 4 + classes)`, middle and size as fractions of the input."""
    table = np.zeros((300, 4 + classes), np.float32)
    table[11, :4] = np.array([box.x, box.y, box.width, box.height]) / [*size, *size]
    return Form(table, 11, 4 + box.class_id)


def yolox(size: tuple[int, int], box: RedBox, classes: int, *, raw: bool) -> Form:
    """YOLOX: `(n, 5 + classes)` for BGR from 0 to 255; `raw`: relative to the cells."""
    grid = np.array(cells(*size), np.float32)
    table = np.zeros((len(grid), 5 + classes), np.float32)
    if not raw:
        table[:, :2] = (grid[:, :2] + 0.5) * grid[:, 2:]
    row = 9
    stride = grid[row, 2]
    middle, sides = np.array([box.x, box.y]), np.array([box.width, box.height])
    table[row, :2] = middle / stride - grid[row, :2] if raw else middle
    table[row, 2:4] = np.log(sides / stride) if raw else sides
    table[row, 5 + box.class_id] = 1
    return Form(table, row, 4, red_channel=2, red=255)


def final(box: RedBox, rows: int = 300) -> Form:
    """After suppression: x1, y1, x2, y2, score, class; empty rows are zero."""
    table = np.zeros((rows, 6), np.float32)
    table[2, :4] = box.corners
    table[2, 5] = box.class_id
    return Form(table, 2, 4)


def write_network(
    path: Path,
    form: Form,
    size: tuple[int, int],
    pixel: tuple[int, int],
    *,
    metadata: Mapping[str, str] | None = None,
    batch: int = 1,
) -> Path:
    """Write a network with one input of `size` whose score is the red of `pixel` of the input."""
    width, height = size
    nodes, constants = _redness("images", pixel, form.red_channel, form.red)
    hot = np.zeros((1, *form.table.shape), np.float32)
    hot[0, form.score_row, form.score_column] = 1
    constants += [_constant(hot, "hot"), _constant(form.table[np.newaxis], "table")]
    nodes += [
        helper.make_node("Mul", ["red", "hot"], ["score"]),
        helper.make_node("Add", ["table", "score"], ["output0"]),
    ]
    inputs = [helper.make_tensor_value_info("images", TensorProto.FLOAT, [batch, 3, height, width])]
    outputs = [helper.make_tensor_value_info("output0", TensorProto.FLOAT, None)]
    return write_graph(path, nodes, inputs, outputs, constants, metadata)


def write_rt_detr(path: Path, box: RedBox, size: tuple[int, int], pixel: tuple[int, int]) -> Path:
    """Write a network with a second input for the size, and outputs labels, boxes and scores."""
    nodes, constants = _redness("images", pixel, 0, 1)
    shares = np.array(box.corners, np.float32) / np.array([*size, *size], np.float32)
    constants += [
        _constant(np.array([[box.class_id]], np.int64), "label"),
        _constant(shares.reshape(1, 1, 4), "shares"),
        _constant(np.array([1, 1], np.int64), "one"),
    ]
    nodes += [
        helper.make_node("Identity", ["label"], ["labels"]),
        helper.make_node("Cast", ["orig_target_sizes"], ["size"], to=TensorProto.FLOAT),
        helper.make_node("Concat", ["size", "size"], ["scale"], axis=1),
        helper.make_node("Mul", ["shares", "scale"], ["boxes"]),
        helper.make_node("Reshape", ["red", "one"], ["scores"]),
    ]
    width, height = size
    inputs = [
        helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, height, width]),
        helper.make_tensor_value_info("orig_target_sizes", TensorProto.INT64, [1, 2]),
    ]
    outputs = [
        helper.make_tensor_value_info("labels", TensorProto.INT64, None),
        helper.make_tensor_value_info("boxes", TensorProto.FLOAT, None),
        helper.make_tensor_value_info("scores", TensorProto.FLOAT, None),
    ]
    return write_graph(path, nodes, inputs, outputs, constants)


def _redness(
    name: str, pixel: tuple[int, int], channel: int, red: float
) -> tuple[list[onnx.NodeProto], list[onnx.TensorProto]]:
    """Return the nodes that give `red`: the value of a pixel of an input, `(1, 1, 1)`."""
    x, y = pixel
    constants = [
        _constant(np.array([channel, y, x], np.int64), "first"),
        _constant(np.array([channel + 1, y + 1, x + 1], np.int64), "end"),
        _constant(np.array([1, 2, 3], np.int64), "axes"),
        _constant(np.array([1, 1, 1], np.int64), "cube"),
        _constant(np.array([red], np.float32), "most"),
    ]
    nodes = [
        helper.make_node("Slice", [name, "first", "end", "axes"], ["value"]),
        helper.make_node("Reshape", ["value", "cube"], ["shaped"]),
        helper.make_node("Div", ["shaped", "most"], ["red"]),
    ]
    return nodes, constants


def _constant(values: npt.NDArray[np.generic], name: str) -> onnx.TensorProto:
    return numpy_helper.from_array(values, name)


def write_endless(path: Path) -> Path:
    """Write a network whose loop has 2^62 rounds."""
    value = helper.make_tensor_value_info
    nodes = [
        helper.make_node("Identity", ["go"], ["still"]),
        helper.make_node("Identity", ["sum"], ["next"]),
    ]
    state = [value("go", TensorProto.BOOL, []), value("sum", TensorProto.FLOAT, [1])]
    after = [value("still", TensorProto.BOOL, []), value("next", TensorProto.FLOAT, [1])]
    body = helper.make_graph(nodes, "body", [value("n", TensorProto.INT64, []), *state], after)
    constants = [
        numpy_helper.from_array(np.array(2**62), "rounds"),
        numpy_helper.from_array(np.array(True), "true"),
        numpy_helper.from_array(np.zeros(1, np.float32), "zero"),
    ]
    loop = helper.make_node("Loop", ["rounds", "true", "zero"], ["end"], body=body)
    add = helper.make_node("Add", ["images", "end"], ["output0"])
    inputs = [value("images", TensorProto.FLOAT, [1, 3, 64, 64])]
    return write_graph(
        path, [loop, add], inputs, [value("output0", TensorProto.FLOAT, None)], constants
    )


def write_slow(path: Path) -> Path:
    """Write a network of one operation that takes long, which onnxruntime cannot stop."""
    weights = _constant(np.ones((3, 3, 127, 127), np.float32), "weights")
    value, sides = helper.make_tensor_value_info, [1, 3, 700, 700]
    nodes = [helper.make_node("Conv", ["images", "weights"], ["output0"])]
    inputs = [value("images", TensorProto.FLOAT, sides)]
    outputs = [value("output0", TensorProto.FLOAT, None)]
    return write_graph(path, nodes, inputs, outputs, [weights])


def write_with_weights_elsewhere(path: Path, location: str) -> Path:
    """Write a network whose weights lie in another file."""
    weights = TensorProto(name="weights", dims=[4], data_type=TensorProto.FLOAT)
    weights.data_location = TensorProto.EXTERNAL
    weights.external_data.add(key="location", value=location)
    value = helper.make_tensor_value_info
    nodes = [helper.make_node("Add", ["images", "weights"], ["output0"])]
    inputs = [value("images", TensorProto.FLOAT, [1, 3, 64, 4])]
    outputs = [value("output0", TensorProto.FLOAT, None)]
    return write_graph(path, nodes, inputs, outputs, [weights])


def write_graph(
    path: Path,
    nodes: Sequence[onnx.NodeProto],
    inputs: Sequence[onnx.ValueInfoProto],
    outputs: Sequence[onnx.ValueInfoProto],
    constants: Sequence[onnx.TensorProto],
    metadata: Mapping[str, str] | None = None,
) -> Path:
    """Write a network of any graph."""
    graph = helper.make_graph(nodes, "detector", inputs, outputs, constants)
    model = helper.make_model(graph, opset_imports=[OPSET], ir_version=IR_VERSION)
    if metadata:
        helper.set_model_props(model, dict(metadata))
    path.write_bytes(model.SerializeToString())
    return path
