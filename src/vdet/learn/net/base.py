"""The weights of an exported network as the base of a training."""

from pathlib import Path
from typing import Any

import numpy.typing as npt
import onnx
import torch
from onnx import numpy_helper
from torch import Tensor, nn

from vdet.errors import DataError
from vdet.learn.net.architecture import Network
from vdet.learn.net.export import convolutions


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
        _load(network, _read(path))
    except Exception as error:  # onnx and torch raise many kinds for a file of another form
        raise DataError(f"{path}: is not a network that vdet train-net has written") from error
    hooks = [
        norm.register_forward_pre_hook(_undo)
        for norm in network.modules()
        if isinstance(norm, nn.BatchNorm2d)
    ]
    network(pictures)
    for hook in hooks:
        hook.remove()


def _read(path: Path) -> list[tuple[Tensor, Tensor]]:
    """Return weight and bias of all convolutions, in the order of the graph."""
    graph = onnx.load(str(path)).graph
    constants = {each.name: numpy_helper.to_array(each) for each in graph.initializer}
    return [
        (_tensor(constants[node.input[1]]), _tensor(constants[node.input[2]]))
        for node in graph.node
        if node.op_type == "Conv"
    ]


def _tensor(values: npt.NDArray[Any]) -> Tensor:
    return torch.from_numpy(values.copy())


def _load(network: Network, folded: list[tuple[Tensor, Tensor]]) -> None:
    for (layer, norm, factor), (weight, bias) in zip(convolutions(network), folded, strict=True):
        layer.weight.copy_(weight.reshape(layer.weight.shape) / factor)
        target = layer.bias if norm is None else norm.bias
        assert target is not None
        target.copy_(bias.reshape(target.shape))


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
