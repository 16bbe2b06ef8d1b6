"""From a trained network to an ONNX file that `vdet.detect.onnx` runs, and back.

The graph takes frames as they are, uint8 `(1, H, W, 3)` in BGR, and gives the raw output of all
cells, float32 `(1, cells, 5 + classes)`. Batch normalisation is part of the convolutions.
"""

import copy
import io
import json
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import onnx
import torch
from onnx import numpy_helper
from torch import Tensor, nn

from vdet.detect.onnx.recognition import HEADER_KEY, Header, read_header
from vdet.detect.onnx.session import Session
from vdet.errors import DataError
from vdet.files import staged
from vdet.learn.net.network import Network

_OPSET = 17
_MIN_WEIGHT = 1e-12  # smaller ones lead to denormal numbers, which are slow


class _FromFrames(nn.Module):
    """A network that takes frames as they are and gives one table of all cells."""

    def __init__(self, network: Network) -> None:
        super().__init__()
        self.network = copy.deepcopy(network).eval()
        with torch.no_grad():
            self.network.stem.weight *= 1 / 255

    def forward(self, image: Tensor) -> Tensor:
        """Return the cells `(1, cells, 5 + classes)` of a frame, uint8 `(1, H, W, 3)`."""
        levels = self.network.levels(image.permute(0, 3, 1, 2).float())
        columns = self.network.columns
        return torch.cat([level.permute(0, 2, 3, 1).reshape(1, -1, columns) for level in levels], 1)


def export_network(
    network: Network, header: Header, path: Path, *, overwrite: bool = False
) -> None:
    """Write a network with its header. Raises `OutputError`."""
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        torch.onnx.export(
            _FromFrames(network),
            (torch.zeros(1, 64, 96, 3, dtype=torch.uint8),),
            buffer,
            input_names=["image"],
            output_names=["cells"],
            dynamic_axes={"image": {1: "H", 2: "W"}, "cells": {1: "N"}},
            opset_version=_OPSET,
            dynamo=False,  # the other exporter needs one more package
        )
    model = onnx.load_model_from_string(buffer.getvalue())
    for constant in model.graph.initializer:
        values = numpy_helper.to_array(constant)
        if values.dtype == np.float32:
            flushed = np.where(np.abs(values) < _MIN_WEIGHT, np.float32(0), values)
            constant.CopyFrom(numpy_helper.from_array(flushed, constant.name))
    write_model(model, header, path, overwrite=overwrite)


def write_model(
    model: onnx.ModelProto, header: Header, path: Path, *, overwrite: bool = False
) -> None:
    """Write the graph of a network of ours with a header. Raises `OutputError`."""
    text = json.dumps(header.model_dump(mode="json"))
    onnx.helper.set_model_props(model, {HEADER_KEY: text})
    onnx.checker.check_model(model)
    with staged(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(model.SerializeToString())


@torch.no_grad()
def start_from(network: Network, path: Path, images: Tensor, classes: Sequence[str]) -> None:
    """Give a network the weights of a file that `export_network` has written.

    Normalisation is part of the convolutions there. Each normalisation of the network gets the
    mean and deviation of what it sees in some images, and undoes itself at first. Layers may be
    wider than those of the file: further channels have random weights and change no output yet.
    So have classes that the file does not know.

    Parameters
    ----------
    classes
        Those of the network, in its order.
    images
        BGR, 0 to 255, float32 `(B, 3, H, W)`: at least a batch as the training shows them.

    Raises
    ------
    DataError
        The file is not a network of this form.
    """
    bias = torch.empty(0)

    def load(layer: nn.Module, inputs: tuple[Tensor]) -> None:
        """Set a layer before it computes: a convolution, or the normalisation behind it."""
        nonlocal bias
        if isinstance(layer, nn.BatchNorm2d):
            variance, mean = torch.var_mean(inputs[0], (0, 2, 3))
            known = slice(len(bias))
            layer.weight[known] = torch.sqrt(variance + layer.eps)[known]
            layer.bias[known] = bias + mean[known]
            layer.load_state_dict({"running_mean": mean, "running_var": variance}, strict=False)
            return
        weight, bias = next(folded)
        rows = list(range(len(weight)))
        if layer.bias is not None:  # a head: its classes may be others, or in another order
            rows, weight, bias = places, weight[columns], bias[columns]
            layer.bias[rows] = bias
        layer.weight[rows] = 0  # the known channels do not depend on further inputs
        layer.weight[rows, : weight.shape[1]] = 255 * weight if layer is network.stem else weight

    layers = [
        module for module in network.modules() if isinstance(module, nn.Conv2d | nn.BatchNorm2d)
    ]
    hooks = [layer.register_forward_pre_hook(load) for layer in layers]
    try:
        header = read_header(Session(path))
        theirs = header.classes if header else ()
        shared = [name for name in classes if name in theirs]
        places = [*range(5), *(5 + classes.index(name) for name in shared)]
        columns = [*range(5), *(5 + theirs.index(name) for name in shared)]
        folded = _convolutions(onnx.load(str(path)).graph)
        network(images)
        if next(folded, None) is not None:
            raise ValueError("more convolutions than the network has")
    except Exception as error:  # onnx and torch raise many kinds for a file of another form
        raise DataError(f"{path}: is not a network of vdet train-net") from error
    finally:
        for hook in hooks:
            hook.remove()


def _convolutions(graph: onnx.GraphProto) -> Iterator[tuple[Tensor, Tensor]]:
    """Yield weight and bias of all convolutions, in the order of the graph."""
    constants = {item.name: numpy_helper.to_array(item) for item in graph.initializer}
    for node in graph.node:
        if node.op_type == "Identity" and node.input[0] in constants:  # equal ones are written once
            constants[node.output[0]] = constants[node.input[0]]
        elif node.op_type == "Conv":
            weight, bias = (torch.tensor(constants[name]) for name in node.input[1:3])
            yield weight, bias
