"""From a trained network to an ONNX file that `vdet.detect.onnx` runs, and back.

The graph takes frames as they are, uint8 `(1, H, W, 3)` in BGR, and gives the raw output of all
cells, float32 `(1, cells, 5 + classes)`. Batch normalisation is part of the convolutions.
"""

import copy
import io
import json
import warnings
from collections.abc import Sequence
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
from vdet.learn.net.architecture import Network

_OPSET = 17
_LEAST_WEIGHT = 1e-12  # smaller ones lead to denormal numbers, which are slow


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
            flushed = np.where(np.abs(values) < _LEAST_WEIGHT, np.float32(0), values)
            constant.CopyFrom(numpy_helper.from_array(flushed, constant.name))
    onnx.helper.set_model_props(model, {HEADER_KEY: json.dumps(header.model_dump(mode="json"))})
    onnx.checker.check_model(model)
    with staged(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(model.SerializeToString())


@torch.no_grad()
def start_from(network: Network, path: Path, pictures: Tensor, classes: Sequence[str]) -> None:
    """Give a network the weights of a file that `export_network` has written.

    Normalisation is part of the convolutions there. Each normalisation of the network gets the
    mean and deviation of what it sees in some pictures, and undoes itself at first. Layers may be
    wider than those of the file: further channels have random weights and change no output yet.
    So have classes that the file does not know.

    Parameters
    ----------
    classes
        Those of the network, in its order.
    pictures
        BGR, 0 to 255, float32 `(B, 3, H, W)`: at least a batch as the training shows them.

    Raises
    ------
    DataError
        The file is not a network of this form.
    """
    biases: list[Tensor] = []

    def load(layer: nn.Module, inputs: tuple[Tensor]) -> None:
        """Set a layer before it computes: a convolution, or the normalisation behind it."""
        if isinstance(layer, nn.Conv2d):
            weight, bias = next(folded)
            factor = 1 / 255 if layer is network.stem else 1.0
            if layer.bias is None:
                rows = list(range(len(weight)))
            else:  # a head: its classes may be others, or in another order
                rows, weight, bias = list(places), weight[list(columns)], bias[list(columns)]
                layer.bias[rows] = bias
            _fill(layer.weight, rows, weight / factor)
            biases.append(bias)
        elif isinstance(layer, nn.BatchNorm2d):
            _undo(layer, inputs[0], biases[-1])

    layers = [
        module for module in network.modules() if isinstance(module, nn.Conv2d | nn.BatchNorm2d)
    ]
    hooks = [layer.register_forward_pre_hook(load) for layer in layers]
    try:
        header = read_header(Session(path))
        theirs = header.classes if header else ()
        pairs = [(5 + n, 5 + classes.index(c)) for n, c in enumerate(theirs) if c in classes]
        columns, places = zip(*((n, n) for n in range(5)), *pairs, strict=True)
        folded = iter(_convolutions(path))
        network(pictures)
        if next(folded, None) is not None:
            raise ValueError("more convolutions than the network has")
    except Exception as error:  # onnx and torch raise many kinds for a file of another form
        raise DataError(f"{path}: is not a network that vdet train-net has written") from error
    finally:
        for hook in hooks:
            hook.remove()


def _convolutions(path: Path) -> list[tuple[Tensor, Tensor]]:
    """Return weight and bias of all convolutions of a file, in the order of the graph."""
    graph = onnx.load(str(path)).graph
    constants = {item.name: numpy_helper.to_array(item) for item in graph.initializer}
    for node in graph.node:
        if node.op_type == "Identity" and node.input[0] in constants:  # equal ones are written once
            constants[node.output[0]] = constants[node.input[0]]
    return [
        (torch.tensor(constants[node.input[1]]), torch.tensor(constants[node.input[2]]))
        for node in graph.node
        if node.op_type == "Conv"
    ]


def _fill(weight: Tensor, rows: Sequence[int], known: Tensor) -> None:
    """Set the weights of the channels `rows`; these do not depend on further inputs."""
    weight[rows] = 0
    weight[rows, : known.shape[1]] = known


def _undo(norm: nn.BatchNorm2d, inputs: Tensor, bias: Tensor) -> None:
    """Set a normalisation so that it changes nothing in the first channels but adds their bias."""
    variance, mean = torch.var_mean(inputs, (0, 2, 3))
    known = len(bias)
    norm.weight[:known] = torch.sqrt(variance + norm.eps)[:known]
    norm.bias[:known] = bias + mean[:known]
    norm.load_state_dict({"running_mean": mean, "running_var": variance}, strict=False)
