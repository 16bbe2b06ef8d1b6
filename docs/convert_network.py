"""Convert a YOLOX or RT-DETR network (.onnx) to a form that vdet reads; needs the package onnx.

    python docs/convert_network.py rtdetr_r18.onnx rtdetr.onnx  # exported by Hugging Face Optimum
    python docs/convert_network.py yolox_s.onnx yolox.onnx      # exported by YOLOX

Both have the 80 classes of COCO and an input of fixed size. The output is `(1, n, 6)`: x1, y1, x2,
y2 in pixels of the input, score, class.
"""

import sys

import numpy as np
from numpy.typing import ArrayLike

try:
    import onnx
    from onnx import ModelProto, compose, numpy_helper, parser, version_converter
except ImportError:
    sys.exit("onnx is not installed; pip install onnx")

OPSET = 17
RT_DETR = """
<ir_version: 8, opset_import: ["" : 17]>
decode (float[1, n, c] raw_logits, float[1, n, 4] raw_boxes) => (float[1, n, 6] detections)
<float[4, 4] corners = {1, 0, 1, 0, 0, 1, 0, 1, -0.5, 0, 0.5, 0, 0, -0.5, 0, 0.5},
 float[4] sides = {1, 1, 1, 1}>
{
    in_pixels = Mul (raw_boxes, sides)
    boxes = MatMul (in_pixels, corners)
    probabilities = Sigmoid (raw_logits)
    scores = ReduceMax <axes = [2], keepdims = 1> (probabilities)
    best = ArgMax <axis = 2, keepdims = 1> (probabilities)
    classes = Cast <to = 1> (best)
    detections = Concat <axis = 2> (boxes, scores, classes)
}
"""
YOLOX = """
<ir_version: 8, opset_import: ["" : 17]>
decode (float[1, n, 85] raw) => (float[1, m, 6] detections)
<float[4, 4] corners = {1, 0, 1, 0, 0, 1, 0, 1, -0.5, 0, 0.5, 0, 0, -0.5, 0, 0.5},
 float[1, 2] cells = {0, 0}, float[1, 1] strides = {1},
 int64[4] parts = {2, 2, 1, 80}, int64[1] most = {300}, float[1] overlap = {0.65},
 float[1] minimum = {0.03}, int64 last = {2}>
{
    offsets, lengths, objectness, class_scores = Split <axis = 2> (raw, parts)
    in_cells = Add (offsets, cells)
    middles = Mul (in_cells, strides)
    factors = Exp (lengths)
    sizes = Mul (factors, strides)
    middles_and_sizes = Concat <axis = 2> (middles, sizes)
    boxes = MatMul (middles_and_sizes, corners)
    probabilities = Mul (objectness, class_scores)
    scores = ReduceMax <axes = [2], keepdims = 1> (probabilities)
    best = ArgMax <axis = 2, keepdims = 1> (probabilities)
    classes = Cast <to = 1> (best)
    all = Concat <axis = 2> (boxes, scores, classes)
    by_row = Transpose <perm = [0, 2, 1]> (scores)
    chosen = NonMaxSuppression (boxes, by_row, most, overlap, minimum)
    rows = Gather <axis = 1> (chosen, last)
    detections = Gather <axis = 1> (all, rows)
}
"""
YOLOX_INPUT = """
<ir_version: 8, opset_import: ["" : 17]>
prepare (float[1, 3, h, w] rgb) => (float[1, 3, h, w] bgr)
<int64[3] order = {2, 1, 0}, float white = {255}>
{
    swapped = Gather <axis = 1> (rgb, order)
    bgr = Mul (swapped, white)
}
"""


def converted(network: ModelProto) -> ModelProto:
    """Return a network whose output vdet reads."""
    network = version_converter.convert_version(network, OPSET)
    network.ir_version = 8
    image = network.graph.input[0]
    height, width = (side.dim_value for side in image.type.tensor_type.shape.dim[2:])
    outputs = [output.name for output in network.graph.output]
    if "pred_boxes" in outputs:
        decode = with_constants(RT_DETR, sides=[width, height, width, height])
        names = [("logits", "raw_logits"), ("pred_boxes", "raw_boxes")]
        return compose.merge_models(
            network, decode, names, outputs=["vdet_detections"], prefix2="vdet_"
        )
    cells = np.array(
        [
            (x, y, stride)
            for stride in (8, 16, 32)
            for y in range(height // stride)
            for x in range(width // stride)
        ]
    )
    prepare = with_constants(YOLOX_INPUT)
    for value, sides in ((prepare.graph.input[0], image), (prepare.graph.output[0], image)):
        value.type.CopyFrom(sides.type)
    network = compose.merge_models(prepare, network, [("bgr", image.name)], prefix1="vdet_")
    decode = with_constants(YOLOX, cells=cells[:, :2], strides=cells[:, 2:])
    return compose.merge_models(network, decode, [(outputs[0], "raw")], prefix2="vdet_")


def with_constants(text: str, **constants: ArrayLike) -> ModelProto:
    """Return the network that a text describes, with other values of some constants."""
    model = parser.parse_model(text)
    for tensor in model.graph.initializer:
        if tensor.name in constants:
            values = np.asarray(constants[tensor.name], np.float32)
            tensor.CopyFrom(numpy_helper.from_array(values, tensor.name))
    return model


if __name__ == "__main__":
    onnx.save(converted(onnx.load(sys.argv[1])), sys.argv[2])
