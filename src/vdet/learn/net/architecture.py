"""The network: a trunk of depthwise blocks, three levels joined both ways, a head for each level.

Depthwise and pointwise convolutions after MobileNet (Howard et al., 2017), levels joined top-down
and bottom-up after PANet (Liu et al., 2018), boxes as distances from the middles of cells after
FCOS (Tian et al., 2019). All widths are multiples of 16, which onnxruntime computes fastest.
"""

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional

from vdet.detect.onnx import layouts
from vdet.detect.onnx.layouts import STRIDES

STEM = 16
TRUNK = ((32, 0), (64, 2), (160, 3), (256, 2))
"""Width of each stage, and the number of blocks behind its first one, which halves the size."""

NECK = 80
"""Width of the joined levels and of the heads."""

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


class Network(nn.Module):
    """From pictures to a score, four distances and the classes of every cell.

    Parameters
    ----------
    classes
        Number of classes of vehicles.
    """

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.columns = 5 + classes
        self.stem = nn.Conv2d(3, STEM, 3, 2, 1, bias=False)
        self.stem_norm = nn.BatchNorm2d(STEM)
        widths = [STEM, *(width for width, _ in TRUNK)]
        self.stages = nn.ModuleList(
            nn.Sequential(Block(before, width, 2), *(Block(width, width) for _ in range(more)))
            for before, (width, more) in zip(widths, TRUNK, strict=False)
        )
        self.lateral = nn.ModuleList(
            nn.Sequential(nn.Conv2d(width, NECK, 1, bias=False), nn.BatchNorm2d(NECK), nn.ReLU())
            for width in widths[-3:]
        )
        self.down = nn.ModuleList(Block(NECK, NECK) for _ in STRIDES[:-1])
        self.up = nn.ModuleList(Block(NECK, NECK, 2) for _ in STRIDES[:-1])
        self.towers = nn.ModuleList(
            nn.Sequential(Block(NECK, NECK), Block(NECK, NECK)) for _ in STRIDES
        )
        heads = [nn.Conv2d(NECK, self.columns, 1) for _ in STRIDES]
        first = torch.zeros(self.columns)
        first[0] = torch.logit(torch.tensor(_FIRST_SCORE))
        for head in heads:
            nn.init.normal_(head.weight, std=0.01)
            head.bias = nn.Parameter(first.clone())
        self.heads = nn.ModuleList(heads)

    def forward(self, pictures: Tensor) -> list[Tensor]:
        """Return the raw output of each level, `(B, 5 + classes, H / stride, W / stride)`.

        The channels are the score before the sigmoid, the distances to the left, top, right and
        bottom side before `decode`, and the classes before the softmax.

        Parameters
        ----------
        pictures
            BGR, 0 to 255, float32 `(B, 3, H, W)`; H and W are multiples of 32.
        """
        return self.levels(pictures / 255)

    def levels(self, pictures: Tensor) -> list[Tensor]:
        """Return the raw output of each level for pictures from 0 to 1, as `forward` does."""
        values = functional.relu(self.stem_norm(self.stem(pictures)))
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


def cell_centers(height: int, width: int) -> tuple[Tensor, Tensor]:
    """Return the middle `(cells, 2)`, x and y in pixels, and the stride `(cells,)` of all cells."""
    centers, strides = layouts.cell_centers(width, height)
    return torch.from_numpy(centers), torch.from_numpy(strides)


def flatten(levels: Sequence[Tensor]) -> Tensor:
    """Return the outputs of all levels as one table, `(B, cells, 5 + classes)`."""
    return torch.cat([level.flatten(2).transpose(1, 2) for level in levels], 1)


def decode(distances: Tensor, centers: Tensor, strides: Tensor) -> Tensor:
    """Return boxes `(B, cells, 4)`: x1, y1, x2, y2 in pixels, of raw distances `(B, cells, 4)`."""
    lengths = functional.softplus(distances + 1) * strides[:, None]
    return torch.cat([centers - lengths[..., :2], centers + lengths[..., 2:]], -1)
