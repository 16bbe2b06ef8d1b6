"""Tiny ONNX files in the forms that vdet reads; each finds boxes that a test chooses.

A box has the score of the red value (0 to 1) of one pixel of the input, so that a test sees which
pixel of the frame lies there, and whether the channels and their range are right.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from onnx import TensorProto, helper, numpy_helper, parser

Array = npt.NDArray[np.float32]


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
        across, down = self.width / 2, self.height / 2
        return self.x - across, self.y - down, self.x + across, self.y + down


def cells(width: int, height: int) -> list[tuple[int, int, int]]:
    """Return x, y and stride of all cells, as Ultralytics orders them."""
    return [
        (x, y, stride)
        for stride in (8, 16, 32)
        for y in range(height // stride)
        for x in range(width // stride)
    ]


@dataclass(frozen=True, slots=True)
class Form:
    """Where the score of a box lies in a table `(rows, columns)`."""

    table: Array
    score_row: int
    score_column: int


def ultralytics(size: tuple[int, int], box: RedBox, classes: int) -> Form:
    """v8 and later: `(4 + classes, n)`."""
    table = np.zeros((4 + classes, len(cells(*size))), np.float32)
    table[:4, 7] = box.x, box.y, box.width, box.height
    return Form(table, 4 + box.class_id, 7)


def final(box: RedBox, rows: int = 300) -> Form:
    """After suppression: x1, y1, x2, y2, score, class; empty rows are zero."""
    table = np.zeros((rows, 6), np.float32)
    table[2, :4] = box.corners
    table[2, 5] = box.class_id
    return Form(table, 2, 4)


RED_PIXEL = """
detector (float[{batch}, 3, {height}, {width}] images) => (float[] output0)
<int64[3] first = {{0, {y}, {x}}}, int64[3] end = {{1, {below}, {beside}}},
 int64[3] axes = {{1, 2, 3}}, int64[3] cube = {{1, 1, 1}}>
{{
    value = Slice (images, first, end, axes)
    red = Reshape (value, cube)
    score = Mul (red, hot)
    output0 = Add (table, score)
}}
"""


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
    (width, height), (x, y) = size, pixel
    text = RED_PIXEL.format(
        batch=batch, height=height, width=width, x=x, y=y, below=y + 1, beside=x + 1
    )
    hot = np.zeros((1, *form.table.shape), np.float32)
    hot[0, form.score_row, form.score_column] = 1
    constants = {"hot": hot, "table": form.table[np.newaxis]}
    tensors = [numpy_helper.from_array(values, name) for name, values in constants.items()]
    return write_graph(path, text, tensors, metadata)


def write_with_weights_elsewhere(path: Path, location: str) -> Path:
    """Write a network whose weights lie in another file."""
    weights = TensorProto(name="weights", dims=[4], data_type=TensorProto.FLOAT)
    weights.data_location = TensorProto.EXTERNAL
    weights.external_data.add(key="location", value=location)
    signature = "detector (float[1, 3, 64, 4] images) => (float[] output0)"
    return write_graph(path, f"{signature} {{ output0 = Add (images, weights) }}", [weights])


def write_graph(
    path: Path,
    text: str,
    constants: Sequence[TensorProto] = (),
    metadata: Mapping[str, str] | None = None,
) -> Path:
    """Write a network of a graph in the text form of ONNX, with further constants."""
    model = parser.parse_model(f'<ir_version: 8, opset_import: ["" : 17]>\n{text}')
    model.graph.initializer.extend(constants)
    if metadata:
        helper.set_model_props(model, dict(metadata))
    path.write_bytes(model.SerializeToString())
    return path
