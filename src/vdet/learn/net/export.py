"""From a trained network to an ONNX file that `vdet.detect.onnx` runs, and back.

The graph takes frames as they are, uint8 `(1, H, W, 3)` in BGR, and gives the raw output of all
cells, float32 `(1, cells, 5 + classes)`. Batch normalisation is part of the convolutions.
"""

import copy
import io
import json
import warnings
from pathlib import Path

import numpy as np
import onnx
import torch
from onnx import numpy_helper
from torch import Tensor, nn

from vdet.detect.onnx.recognition import HEADER_KEY, Header
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
def start_from(network: Network, path: Path, pictures: Tensor) -> None:
    """Give a network the weights of a file that `export_network` has written.

    Normalisation is part of the convolutions there. Each normalisation of the network gets the
    mean and deviation of what it sees in some pictures, and undoes itself at first.

    Parameters
    ----------
    pictures
        BGR, 0 to 255, float32 `(B, 3, H, W)`: at least a batch as the training shows them.

    Raises
    ------
    DataError
        The file is not a network of this form.
    """
    try:
        folded = _convolutions(path)
        for (layer, norm), (weight, bias) in zip(_layers(network), folded, strict=True):
            factor = 1 / 255 if layer is network.stem else 1.0
            layer.weight.copy_(weight.reshape(layer.weight.shape) / factor)
            target = layer.bias if norm is None else norm.bias
            assert target is not None
            target.copy_(bias.reshape(target.shape))
    except Exception as error:  # onnx and torch raise many kinds for a file of another form
        raise DataError(f"{path}: is not a network that vdet train-net has written") from error
    norms = [norm for norm in network.modules() if isinstance(norm, nn.BatchNorm2d)]
    hooks = [norm.register_forward_pre_hook(_undo) for norm in norms]
    network(pictures)
    for hook in hooks:
        hook.remove()


def _convolutions(path: Path) -> list[tuple[Tensor, Tensor]]:
    """Return weight and bias of all convolutions of a file, in the order of the graph."""
    graph = onnx.load(str(path)).graph
    constants = {each.name: numpy_helper.to_array(each) for each in graph.initializer}
    for node in graph.node:
        if node.op_type == "Identity" and node.input[0] in constants:  # equal ones are written once
            constants[node.output[0]] = constants[node.input[0]]
    return [
        (torch.tensor(constants[node.input[1]]), torch.tensor(constants[node.input[2]]))
        for node in graph.node
        if node.op_type == "Conv"
    ]


def _layers(network: Network) -> list[tuple[nn.Conv2d, nn.BatchNorm2d | None]]:
    """Return the convolutions in the order of the graph, each with its normalisation."""
    calls: list[nn.Module] = []

    def note(layer: nn.Module, *_: object) -> None:
        calls.append(layer)

    kinds = nn.Conv2d | nn.BatchNorm2d
    layers = [each for each in network.modules() if isinstance(each, kinds)]
    hooks = [layer.register_forward_hook(note) for layer in layers]
    network.eval()(torch.zeros(1, 3, 32, 32))
    network.train()
    for hook in hooks:
        hook.remove()
    pairs = zip(calls, [*calls[1:], None], strict=True)
    return [
        (layer, norm if isinstance(norm, nn.BatchNorm2d) else None)
        for layer, norm in pairs
        if isinstance(layer, nn.Conv2d)
    ]


def _undo(norm: nn.Module, inputs: tuple[Tensor]) -> None:
    """Set a normalisation so that it changes nothing but adds its bias."""
    assert isinstance(norm, nn.BatchNorm2d)
    assert norm.running_mean is not None
    assert norm.running_var is not None
    variance, mean = torch.var_mean(inputs[0], (0, 2, 3))
    norm.running_mean.copy_(mean)
    norm.running_var.copy_(variance)
    norm.weight.copy_(torch.sqrt(variance + norm.eps))
    norm.bias.add_(mean)
