"""From a trained network to an ONNX file that `vdet.detect.onnx` runs, and back.

The graph takes frames as they are, uint8 `(1, H, W, 3)` in BGR, and gives the raw output of all
cells, float32 `(1, cells, 5 + classes)`. Batch normalisation is part of the convolutions.
"""

import copy
import io
import json
import warnings
from collections.abc import Mapping, Sequence
from itertools import zip_longest
from pathlib import Path

import numpy as np
import onnx
import torch
from onnx import numpy_helper
from torch import Tensor, nn

from vdet.detect.onnx.network import HEADER_KEY, Header, Session, read_header
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
    """Write the graph of a network of vdet train-net with a header. Raises `OutputError`."""
    text = json.dumps(header.model_dump(mode="json"))
    onnx.helper.set_model_props(model, {HEADER_KEY: text})
    onnx.checker.check_model(model)
    with staged(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(model.SerializeToString())


@torch.no_grad()
def start_from(network: Network, path: Path, images: Tensor, classes: Sequence[str]) -> None:
    """Give a network the weights of a file that `export_network` has written.

    Normalisation is part of the convolutions there, so the normalisations of the network are set to
    change nothing at first. Layers may be wider than those of the file: further channels have
    random weights, on which no output depends yet. The same holds for classes that the file does
    not have.

    Parameters
    ----------
    images
        BGR, 0 to 255, float32 `(B, 3, H, W)`: at least a batch as the training shows them.
    classes
        Those of the network, in its order.

    Raises
    ------
    DataError
        The file is not a network of this form.
    """
    try:
        header = read_header(Session(path))
        columns = _matching_columns(classes, header.classes if header else ())
        biases = {}
        folded = _folded_convolutions(onnx.load(str(path)).graph)
        for (layer, norm), (weight, bias) in zip(_layers(network), folded, strict=True):
            if norm is None:  # a head
                for column, base_column in columns:
                    _load(layer.weight[column : column + 1], weight[[base_column]])
                    layer.bias[column] = bias[base_column]
            else:
                _load(layer.weight, 255 * weight if layer is network.stem else weight)
                biases[norm] = bias
        _calibrate(network, biases, images)
    except Exception as error:  # onnx and torch raise many kinds for a file of another form
        raise DataError(f"{path}: is not a network of vdet train-net") from error


def _folded_convolutions(graph: onnx.GraphProto) -> list[tuple[Tensor, Tensor]]:
    """Return the weight and bias of all convolutions, in the order of the graph."""
    constants = {item.name: numpy_helper.to_array(item) for item in graph.initializer}
    convolutions = []
    for node in graph.node:
        if node.op_type == "Identity" and node.input[0] in constants:  # equal ones are written once
            constants[node.output[0]] = constants[node.input[0]]
        elif node.op_type == "Conv":
            weight, bias = (torch.tensor(constants[name]) for name in node.input[1:3])
            convolutions.append((weight, bias))
    return convolutions


def _layers(network: Network) -> list[tuple[nn.Conv2d, nn.BatchNorm2d | None]]:
    """Return all convolutions, each with its normalisation, in the order in which they compute.

    That is the order of the graph. Heads have no normalisation.
    """
    branches = [part for pair in zip(network.towers, network.heads, strict=True) for part in pair]
    joined = network.lateral, network.down, network.up
    parts = network.stem, network.stem_norm, network.stages, *joined, *branches
    modules = [module for part in parts for module in part.modules()]
    layers = [module for module in modules if isinstance(module, nn.Conv2d | nn.BatchNorm2d)]
    return [
        (layer, following if isinstance(following, nn.BatchNorm2d) else None)
        for layer, following in zip_longest(layers, layers[1:])
        if isinstance(layer, nn.Conv2d)
    ]


def _load(weight: Tensor, values: Tensor) -> None:
    """Set the first channels of a weight; they do not depend on further inputs."""
    outputs, inputs = values.shape[:2]
    weight[:outputs] = 0
    weight[:outputs, :inputs] = values


def _matching_columns(classes: Sequence[str], base_classes: Sequence[str]) -> list[tuple[int, int]]:
    """Return the columns of a network's output with those of its base that mean the same."""
    shared = [name for name in classes if name in base_classes]
    return [(column, column) for column in range(5)] + [
        (5 + classes.index(name), 5 + base_classes.index(name)) for name in shared
    ]


def _calibrate(network: Network, biases: Mapping[nn.Module, Tensor], images: Tensor) -> None:
    """Set each normalisation so that, for these images, it adds a bias and does nothing else.

    It gets the mean and variance of its inputs, and undoes itself with its own weight and bias.
    """

    def calibrate(norm: nn.BatchNorm2d, inputs: tuple[Tensor]) -> None:
        variance, mean = torch.var_mean(inputs[0], (0, 2, 3))
        bias = biases[norm]
        norm.weight[: len(bias)] = torch.sqrt(variance + norm.eps)[: len(bias)]
        norm.bias[: len(bias)] = bias + mean[: len(bias)]
        norm.load_state_dict({"running_mean": mean, "running_var": variance}, strict=False)

    hooks = [norm.register_forward_pre_hook(calibrate) for norm in biases]
    network(images)
    for hook in hooks:
        hook.remove()
