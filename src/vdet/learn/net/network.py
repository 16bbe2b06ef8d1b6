"""The network, its loss, and its export.

The network, and its loss: a trunk of depthwise blocks, three levels joined both ways, heads.

Depthwise and pointwise convolutions after MobileNet (Howard et al., 2017), levels joined top-down
and bottom-up after PANet (Liu et al., 2018), boxes as distances from the middles of cells after
FCOS (Tian et al., 2019). All widths are multiples of 16, which onnxruntime computes fastest.

From a trained network to an ONNX file that `vdet.detect.onnx` runs, and back.

The graph takes frames as they are, uint8 `(1, H, W, 3)` in BGR, and gives the raw output of all
cells, float32 `(1, cells, 5 + classes)`. Batch normalisation is part of the convolutions.
"""

import copy
import io
import json
import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

import numpy as np
import onnx
import torch
from onnx import numpy_helper
from torch import Tensor, nn
from torch.nn import functional

from vdet.detect.onnx.network import HEADER_KEY, STRIDES, Header, Session, cell_centers, read_header
from vdet.errors import DataError
from vdet.files import staged
from vdet.learn.net.sources import UNLABELLED, NetSource

STEM = 16
TRUNK = ((32, 0), (64, 2), (240, 3), (384, 2))
"""Channels of each stage, and the number of blocks behind its first one, which halves the size.

A channel costs least in the last two stages. With 160 and 256 there, and 80 in the neck, a network
has 0.53 of the parameters and takes 0.70 of the time for an image.
"""

NECK = 96
"""Channels of the joined levels and of the heads."""

_FIRST_SCORE = 0.01
"""Score of every cell before training, so that the many empty cells do not dominate the loss."""


class Block(nn.Module):
    """Depthwise 5×5 and pointwise convolution, added to the input where the shapes agree."""

    def __init__(self, inputs: int, outputs: int, stride: int = 1) -> None:
        super().__init__()
        self.depthwise = nn.Conv2d(inputs, inputs, 5, stride, 2, groups=inputs, bias=False)
        self.depthwise_norm = nn.BatchNorm2d(inputs)
        self.pointwise = nn.Conv2d(inputs, outputs, 1, bias=False)
        self.pointwise_norm = nn.BatchNorm2d(outputs)
        self.is_residual = stride == 1 and inputs == outputs

    def forward(self, values: Tensor) -> Tensor:
        """Return the output, `(B, outputs, H / stride, W / stride)`."""
        inside = functional.relu(self.depthwise_norm(self.depthwise(values)))
        out = self.pointwise_norm(self.pointwise(inside))
        return functional.relu(out + values if self.is_residual else out)


def multiplied(channels: int, factor: float) -> int:
    """Return the number of channels times a factor, as a multiple of 16."""
    return max(16, 16 * math.floor(channels * factor / 16 + 0.5))


class Network(nn.Module):
    """From images to a score, four distances and the classes of every cell.

    Parameters
    ----------
    classes
        Number of classes of vehicles.
    channels
        Factor of the channels of all layers, which are rounded to multiples of 16.
    """

    def __init__(self, classes: int, channels: float = 1.0) -> None:
        super().__init__()
        self.columns = 5 + classes
        stem, neck = multiplied(STEM, channels), multiplied(NECK, channels)
        self.stem = nn.Conv2d(3, stem, 3, 2, 1, bias=False)
        self.stem_norm = nn.BatchNorm2d(stem)
        widths = [stem, *(multiplied(width, channels) for width, _ in TRUNK)]
        self.stages = nn.ModuleList(
            nn.Sequential(Block(before, width, 2), *(Block(width, width) for _ in range(more)))
            for before, width, (_, more) in zip(widths, widths[1:], TRUNK, strict=False)
        )
        self.lateral = nn.ModuleList(
            nn.Sequential(nn.Conv2d(width, neck, 1, bias=False), nn.BatchNorm2d(neck), nn.ReLU())
            for width in widths[-3:]
        )
        self.down = nn.ModuleList(Block(neck, neck) for _ in STRIDES[:-1])
        self.up = nn.ModuleList(Block(neck, neck, 2) for _ in STRIDES[:-1])
        self.towers = nn.ModuleList(
            nn.Sequential(Block(neck, neck), Block(neck, neck)) for _ in STRIDES
        )
        heads = [nn.Conv2d(neck, self.columns, 1) for _ in STRIDES]
        first = torch.zeros(self.columns)
        first[0] = torch.logit(torch.tensor(_FIRST_SCORE))
        for head in heads:
            nn.init.normal_(head.weight, std=0.01)
            head.bias = nn.Parameter(first.clone())
        self.heads = nn.ModuleList(heads)

    def forward(self, images: Tensor) -> list[Tensor]:
        """Return the raw output of each level, `(B, 5 + classes, H / stride, W / stride)`.

        The channels are the score before the sigmoid, the distances to the left, top, right and
        bottom side before `decode`, and the classes before the softmax.

        Parameters
        ----------
        images
            BGR, 0 to 255, float32 `(B, 3, H, W)`; H and W are multiples of 32.
        """
        return self.levels(images / 255)

    def levels(self, images: Tensor) -> list[Tensor]:
        """Return the raw output of each level for images from 0 to 1, as `forward` does."""
        values = functional.relu(self.stem_norm(self.stem(images)))
        levels = []
        for stage in self.stages:
            values = stage(values)
            levels.append(values)
        low, middle, high = (
            join(level) for join, level in zip(self.lateral, levels[1:], strict=True)
        )
        middle = self.down[0](middle + functional.interpolate(high, scale_factor=2.0))
        low = self.down[1](low + functional.interpolate(middle, scale_factor=2.0))
        middle = middle + self.up[0](low)
        high = high + self.up[1](middle)
        parts = zip((low, middle, high), self.towers, self.heads, strict=True)
        return [head(tower(level)) for level, tower, head in parts]


def flatten(levels: Sequence[Tensor]) -> Tensor:
    """Return the outputs of all levels as one table, `(B, cells, 5 + classes)`."""
    return torch.cat([level.flatten(2).transpose(1, 2) for level in levels], 1)


def decode(distances: Tensor, centers: Tensor, strides: Tensor) -> Tensor:
    """Return boxes `(B, cells, 4)`: x1, y1, x2, y2 in pixels, of raw distances `(B, cells, 4)`."""
    lengths = functional.softplus(distances + 1) * strides[:, None]
    return torch.cat([centers - lengths[..., :2], centers + lengths[..., 2:]], -1)


CANDIDATES = 13
"""The best overlaps of a vehicle that decide how many cells it gets."""

_BOX_WEIGHT, _CLASS_WEIGHT = 2.0, 0.4  # of the loss of a score: 1
_IOU_WEIGHT = 3.0
_FAR = 3.0  # strides from the middle where the cost of the distance is 1
_MIN_REACH = 0.6  # strides around the middle of a small vehicle whose cells may find it
_NEVER = 1e8
_BALANCE = 0.5
"""Exponent of the frequency of a class, relative to the most frequent one, in its weight."""
_MAX_WEIGHT = 6.0
"""Largest weight of a class."""


@dataclass(frozen=True, slots=True, eq=False)
class Vehicles:
    """The labelled vehicles of a batch, one row each.

    Attributes
    ----------
    image
        int64 `(n,)`: the number of its image in the batch.
    boxes
        float32 `(n, 4)`: x1, y1, x2, y2, pixels of the input.
    classes
        int64 `(n,)`: its class, -1 where it is not known.
    """

    image: Tensor
    boxes: Tensor
    classes: Tensor

    def __len__(self) -> int:
        return len(self.boxes)

    def to(self, device: torch.device) -> "Vehicles":
        """Return them on a device."""
        return Vehicles(self.image.to(device), self.boxes.to(device), self.classes.to(device))


@dataclass(frozen=True, slots=True, eq=False)
class Batch:
    """Training images of one step.

    `images` are BGR, uint8 or float32 `(B, 3, H, W)` from 0 to 255; `ignored` are the ignore
    regions, as `Vehicles`.
    """

    images: Tensor
    vehicles: Vehicles
    ignored: Vehicles

    def to(self, device: torch.device) -> "Batch":
        """Return it on a device, with images as float32."""
        images = self.images.to(device).float()
        return Batch(images, self.vehicles.to(device), self.ignored.to(device))


def class_weights(sources: Sequence[NetSource], count: int) -> Tensor:
    """Return the weight of each class in the loss, float32 `(count + 1,)`; rare ones have more.

    The last one is that of vehicles of unknown kind, 1. The most frequent class has 1 too.
    """
    counts = np.zeros(count + 1)
    for sample in (sample for source in sources for sample in source.samples):
        counts += np.bincount(sample.classes[~sample.ignored] % (count + 1), minlength=count + 1)
    weights = (counts[:count].max() / np.maximum(counts, 1)) ** _BALANCE
    return torch.tensor([*np.minimum(weights[:count], _MAX_WEIGHT), 1.0], dtype=torch.float32)


def loss_of(network: Network, batch: Batch, weights: Tensor) -> Tensor:
    """Return the loss of a batch, a number; `weights` are those of `class_weights`.

    The target of a cell's score is the overlap of its box with the vehicle that it is to find, and
    0 for others (Li et al., "Generalized Focal Loss", 2020). Boxes are compared by generalised
    overlap, classes by cross entropy.
    """
    device = batch.images.device
    height, width = batch.images.shape[2:]
    centers, strides = (torch.from_numpy(v).to(device) for v in cell_centers(width, height))
    with torch.autocast(device.type, torch.bfloat16, enabled=device.type == "cuda"):
        levels = network(batch.images)
    raw = flatten(levels).float()
    scores, boxes = raw[..., 0], decode(raw[..., 1:5], centers, strides)
    row, cell, iou = assign(scores, boxes, batch.vehicles, centers, strides)
    cells = batch.vehicles.image[row], cell
    targets = torch.zeros_like(scores)
    targets[cells] = iou
    classes = batch.vehicles.classes[row]
    counted = torch.ones_like(scores)
    counted[uncounted(batch.ignored, centers, raw[..., 5:].detach().argmax(-1))] = 0
    counted[cells] = weights[classes].sqrt()
    distance = (targets - scores.sigmoid()).abs()
    focal = functional.binary_cross_entropy_with_logits(scores, targets, reduction="none")
    score_loss = (focal * distance.square() * counted).sum()
    box_loss = ((1 - giou(boxes[cells], batch.vehicles.boxes[row])) * iou).sum()
    class_loss = functional.cross_entropy(
        raw[..., 5:][cells], classes, weights[:-1], ignore_index=UNLABELLED, reduction="sum"
    )
    of_places = (score_loss + _BOX_WEIGHT * box_loss) / iou.sum().clamp(min=1)
    return of_places + _CLASS_WEIGHT * class_loss / max(len(iou), 1)


@torch.no_grad()
def assign(
    scores: Tensor, boxes: Tensor, vehicles: Vehicles, centers: Tensor, strides: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """Return which cells are to find which vehicle; a cell has at most one.

    The cost of a cell for a vehicle is low where the cell's box and score already fit and its
    middle is close. Each vehicle gets its cheapest cells: as many as the sum of its best overlaps.
    Source: Lyu et al., "RTMDet", 2022, after Ge et al., "YOLOX", 2021 (SimOTA).

    Parameters
    ----------
    scores
        Before the sigmoid, `(B, cells)`.
    boxes
        `(B, cells, 4)`: x1, y1, x2, y2, pixels.
    centers, strides
        Of the cells, see `cell_centers`.

    Returns
    -------
    row, cell, iou
        The row of each vehicle, the cell in its image, and the overlap of their boxes; all
        `(m,)`.
    """
    middle = (vehicles.boxes[:, :2] + vehicles.boxes[:, 2:]) / 2
    half = (vehicles.boxes[:, 2:] - vehicles.boxes[:, :2]) / 2
    offset = (centers[None] - middle[:, None]).abs()
    reach = torch.maximum(half[:, None], _MIN_REACH * strides[None, :, None])
    row, cell = torch.nonzero((offset < reach).all(-1), as_tuple=True)
    image = vehicles.image[row]
    iou = paired_iou(boxes[image, cell], vehicles.boxes[row])
    logits = scores[image, cell]
    score_cost = functional.binary_cross_entropy_with_logits(logits, iou, reduction="none")
    distance = offset[row, cell].norm(dim=-1) / strides[cell]
    costs = torch.full((len(vehicles), len(centers)), _NEVER, device=scores.device)
    overlaps = torch.zeros_like(costs)
    overlaps[row, cell] = iou
    costs[row, cell] = (
        score_cost * (iou - logits.sigmoid()).square()
        - _IOU_WEIGHT * torch.log(iou + 1e-7)
        + 10 ** (distance - _FAR)
    )
    count = overlaps.topk(CANDIDATES, dim=1).values.sum(1).int().clamp(min=1)
    cheapest = costs.topk(CANDIDATES, dim=1, largest=False)
    is_cheap = torch.arange(CANDIDATES, device=count.device)[None] < count[:, None]
    chosen = torch.full_like(costs, _NEVER)
    chosen.scatter_(1, cheapest.indices, cheapest.values.where(is_cheap, _NEVER))
    of_cells = vehicles.image[:, None].expand_as(chosen)
    lowest = torch.full_like(scores, _NEVER).scatter_reduce(0, of_cells, chosen, "amin")
    is_taken = (chosen < _NEVER) & (chosen == lowest[vehicles.image])
    row, cell = torch.nonzero(is_taken, as_tuple=True)
    return row, cell, overlaps[row, cell]


def uncounted(ignored: Vehicles, centers: Tensor, seen: Tensor) -> tuple[Tensor, Tensor]:
    """Return the image and the cell of all cells whose middle lies in an ignore region.

    Of a region with a class, only the cells that see it: `seen` is the best class `(B, cells)`.
    """
    boxes = ignored.boxes[:, None]
    inside = ((centers > boxes[..., :2]) & (centers < boxes[..., 2:])).all(-1)
    classes = ignored.classes[:, None]
    inside &= (classes == UNLABELLED) | (classes == seen[ignored.image])
    row, cell = torch.nonzero(inside, as_tuple=True)
    return ignored.image[row], cell


def paired_iou(a: Tensor, b: Tensor) -> Tensor:
    """Return the overlap of each box of `a` with the same row of `b`: `(n, 4)` to `(n,)`."""
    common, union, _ = _areas(a, b)
    return common / union


def giou(a: Tensor, b: Tensor) -> Tensor:
    """Return the generalised overlap, -1 to 1, of each box with the same row of the other.

    Source: Rezatofighi et al., "Generalized Intersection over Union", 2019.
    """
    common, union, around = _areas(a, b)
    return common / union - (around - union) / around


def _areas(a: Tensor, b: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Return the areas in common, of the union, and of the smallest box around both."""
    near, far = torch.maximum(a[:, :2], b[:, :2]), torch.minimum(a[:, 2:], b[:, 2:])
    common = (far - near).clamp(min=0).prod(1)
    union = (a[:, 2:] - a[:, :2]).prod(1) + (b[:, 2:] - b[:, :2]).prod(1) - common
    first, last = torch.minimum(a[:, :2], b[:, :2]), torch.maximum(a[:, 2:], b[:, 2:])
    return common, union.clamp(min=1e-6), (last - first).prod(1).clamp(min=1e-6)


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
