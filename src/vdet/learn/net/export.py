"""From a trained network to an ONNX file that `vdet.detect.onnx` runs.

The graph takes frames as they are, uint8 `(1, H, W, 3)` in BGR, and gives the raw output of all
cells, float32 `(1, cells, 5 + classes)`. Batch normalisation is part of the convolutions.
"""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import onnx
import torch
from onnx import TensorProto, helper, numpy_helper
from torch import Tensor, nn

from vdet.detect.onnx.recognition import HEADER_KEY, Header
from vdet.files import staged
from vdet.learn.net.architecture import Block, Network

_OPSET = 17
_IR_VERSION = 8  # of 2021, which every onnxruntime in use reads
_LEAST_WEIGHT = 1e-12  # smaller ones lead to denormal numbers, which are slow


def export_network(
    network: Network, header: Header, path: Path, *, overwrite: bool = False
) -> None:
    """Write a network with its header. Raises `OutputError`."""
    graph = _Graph()
    model = graph.model(_add_network(graph, network))
    helper.set_model_props(model, {HEADER_KEY: json.dumps(header.model_dump(mode="json"))})
    onnx.checker.check_model(model)
    with staged(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(model.SerializeToString())


def convolutions(network: Network) -> list["Convolution"]:
    """Return the convolutions of a network in the order of the exported graph."""
    graph = _Graph()
    _add_network(graph, network)
    return graph.convolutions


def _add_network(graph: "_Graph", network: Network) -> str:
    """Add all layers; return the name of the output."""
    values = graph.add("Cast", "image", to=TensorProto.FLOAT)
    values = graph.add("Transpose", values, perm=[0, 3, 1, 2])
    stem = graph.convolution(values, network.stem, network.stem_norm, factor=1 / 255)
    values, levels = graph.add("Relu", stem), []
    for stage in network.stages:
        values = graph.sequence(values, stage)
        levels.append(values)
    low, middle, high = (
        graph.sequence(level, lateral)
        for level, lateral in zip(levels[1:], network.lateral, strict=True)
    )
    middle = graph.sequence(graph.add("Add", middle, graph.doubled(high)), [network.down[0]])
    low = graph.sequence(graph.add("Add", low, graph.doubled(middle)), [network.down[1]])
    middle = graph.add("Add", middle, graph.sequence(low, [network.up[0]]))
    high = graph.add("Add", high, graph.sequence(middle, [network.up[1]]))
    tables = []
    for level, tower, head in zip((low, middle, high), network.towers, network.heads, strict=True):
        raw = graph.convolution(graph.sequence(level, tower), head)
        rows = graph.add("Transpose", raw, perm=[0, 2, 3, 1])
        shape = graph.constant(np.array([1, -1, head.out_channels], np.int64))
        tables.append(graph.add("Reshape", rows, shape))
    return graph.add("Concat", *tables, axis=1)


class Convolution(NamedTuple):
    """A convolution, the normalisation that follows it, and the factor of its input."""

    layer: nn.Conv2d
    norm: nn.BatchNorm2d | None
    factor: float


class _Graph:
    """An ONNX graph that grows layer by layer; values are named by numbers."""

    def __init__(self) -> None:
        self._nodes: list[onnx.NodeProto] = []
        self._constants: list[onnx.TensorProto] = []
        self.convolutions: list[Convolution] = []

    def add(self, kind: str, *inputs: str, **attributes: Any) -> str:
        """Add a node and return the name of its output."""
        name = f"{kind.lower()}{len(self._nodes)}"
        self._nodes.append(helper.make_node(kind, list(inputs), [name], **attributes))
        return name

    def constant(self, values: npt.NDArray[Any]) -> str:
        name = f"constant{len(self._constants)}"
        self._constants.append(numpy_helper.from_array(values, name))
        return name

    def doubled(self, values: str) -> str:
        """Return the values at twice the resolution, by nearest neighbour."""
        scales = self.constant(np.array([1, 1, 2, 2], np.float32))
        return self.add(
            "Resize",
            values,
            "",
            scales,
            mode="nearest",
            coordinate_transformation_mode="asymmetric",
            nearest_mode="floor",
        )

    def convolution(
        self, values: str, layer: nn.Module, norm: nn.Module | None = None, factor: float = 1.0
    ) -> str:
        """Add a convolution whose input is multiplied by `factor`, with its normalisation."""
        assert isinstance(layer, nn.Conv2d)
        assert norm is None or isinstance(norm, nn.BatchNorm2d)
        self.convolutions.append(Convolution(layer, norm, factor))
        weight, bias = _folded(layer, norm)
        return self.add(
            "Conv",
            values,
            self.constant(_flushed(weight * factor)),
            self.constant(_flushed(bias)),
            kernel_shape=list(layer.kernel_size),
            strides=list(layer.stride),
            pads=[int(each) for each in layer.padding] * 2,
            group=layer.groups,
        )

    def sequence(self, values: str, layers: Iterable[nn.Module]) -> str:
        """Add blocks, and convolutions that are followed by a normalisation and ReLU."""
        parts = list(layers)
        while parts:
            layer = parts.pop(0)
            if isinstance(layer, Block):
                values = self._block(values, layer)
            else:
                values = self.add("Relu", self.convolution(values, layer, parts.pop(0)))
                parts.pop(0)
        return values

    def _block(self, values: str, block: Block) -> str:
        inside = self.convolution(values, block.depthwise, block.depthwise_norm)
        out = self.convolution(self.add("Relu", inside), block.pointwise, block.pointwise_norm)
        return self.add("Relu", self.add("Add", out, values) if block.is_residual else out)

    def model(self, output: str) -> onnx.ModelProto:
        """Return the graph as a model of one input, `image`, and one output, `cells`."""
        self._nodes.append(helper.make_node("Identity", [output], ["cells"]))
        graph = helper.make_graph(
            self._nodes,
            "vdet",
            [helper.make_tensor_value_info("image", TensorProto.UINT8, [1, "H", "W", 3])],
            [helper.make_tensor_value_info("cells", TensorProto.FLOAT, [1, "N", None])],
            self._constants,
        )
        return helper.make_model(
            graph, opset_imports=[helper.make_opsetid("", _OPSET)], ir_version=_IR_VERSION
        )


@torch.no_grad()
def _folded(layer: nn.Conv2d, norm: nn.BatchNorm2d | None) -> tuple[Tensor, Tensor]:
    """Return weight and bias of a convolution with the normalisation that follows it."""
    if norm is None:
        assert layer.bias is not None
        return layer.weight, layer.bias
    assert norm.running_var is not None
    assert norm.running_mean is not None
    scale = norm.weight / torch.sqrt(norm.running_var + norm.eps)
    return layer.weight * scale[:, None, None, None], norm.bias - norm.running_mean * scale


def _flushed(values: Tensor) -> npt.NDArray[np.float32]:
    array = values.detach().numpy().astype(np.float32)
    return np.where(np.abs(array) < _LEAST_WEIGHT, np.float32(0), array)
