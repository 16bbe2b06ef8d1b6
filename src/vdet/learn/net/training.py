"""The training of the network: steps, learning rate, moving average, checkpoints."""

import copy
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from vdet.config.train import NetworkTrainingSettings
from vdet.errors import DataError
from vdet.files import staged
from vdet.learn.net.architecture import Network, cell_centers, decode, flatten
from vdet.learn.net.assignment import Vehicles, assign
from vdet.learn.net.augmentation import Drawing, SampleDrawer
from vdet.learn.net.export import start_from
from vdet.learn.net.losses import BOX_WEIGHT, CLASS_WEIGHT, giou, quality_focal_loss
from vdet.learn.net.sources import UNKNOWN, NetSample, NetSource, join
from vdet.run.threads import prefetch

CHECKPOINT = 500
"""Steps between two checkpoints."""
_SEED = 0
"""Seed of the weights and the pictures."""
_SMALL = 0.35
"""Fraction of the steps, at the start, with pictures of half the size."""
_PLAIN = 0.12
"""Fraction of the steps, at the end, without mosaics."""
_MOSAICS = 0.35
"""Fraction of pictures put together of four."""
_WARM_UP = 200
"""Steps in which the learning rate rises, or a tenth of all if that is less."""
_LAST_RATE = 0.02
"""Last learning rate, as a fraction of the highest."""
_WEIGHT_DECAY = 0.02
_LONGEST_GRADIENT = 10.0
_BALANCE = 0.5
"""Exponent of the frequency of a class, relative to the most frequent one, in its weight."""
_MOST_WEIGHT = 6.0
"""Largest weight of a class."""
_AVERAGE = 0.998
"""Share that the moving average of the weights keeps at each step."""
_MAGNIFIED = 1.4  # scale of the small pictures, whose vehicles would be too small


StepProgress = Callable[[int, float], object]
"""Called after each step, with the number of steps so far and the loss."""


@dataclass(frozen=True, slots=True, eq=False)
class Batch:
    """Training pictures of one step.

    `pictures` are the inputs of the network; `ignored` are the ignore regions, as `Vehicles`.
    """

    pictures: Tensor
    vehicles: Vehicles
    ignored: Vehicles


def _batches(
    sources: Sequence[NetSource], settings: NetworkTrainingSettings, first: int
) -> Iterator[Batch]:
    """Yield the batches from step `first` on; each depends on the step and the seed alone."""
    drawer = SampleDrawer(sources, settings)
    for step in range(first, settings.steps):
        rng = np.random.default_rng((_SEED, step))
        drawing = _drawing(settings, step)
        yield _to_batch([drawer.draw(rng, drawing) for _ in range(settings.batch)])


def _drawing(settings: NetworkTrainingSettings, step: int) -> Drawing:
    is_small = step < _SMALL * settings.steps
    is_plain = step >= (1 - _PLAIN) * settings.steps
    mosaics = 0.0 if is_plain else _MOSAICS
    if is_small:
        return Drawing(settings.width // 2, settings.height // 64 * 32, _MAGNIFIED, mosaics)
    return Drawing(settings.width, settings.height, 1.0, mosaics)


def train_network(
    sources: Sequence[NetSource],
    settings: NetworkTrainingSettings,
    checkpoint: Path,
    *,
    base: Path | None = None,
    progress: StepProgress = lambda *_: None,
) -> Network:
    """Train a network and return it with the moving average of its weights.

    The same sources and settings give the same network on the same machine. A training that was
    stopped resumes from its last checkpoint.

    Parameters
    ----------
    sources
        At least one, each with at least one sample.
    checkpoint
        File of the last checkpoint; it is made and replaced, and read where it exists.
    base
        An exported network from whose weights the training starts.

    Raises
    ------
    DataError
        No source has a vehicle, a weight is given to a source that is not there, the base is not
        such a network, or the checkpoint belongs to another training.
    """
    _check(sources, settings)
    learnt_with = {
        "sources": [(source.name, len(source.samples)) for source in sources],
        "base": str(base),
        **settings.model_dump(exclude={"score"}),  # it changes no weight
    }
    with _fast_torch():
        run = _Run(settings, learnt_with, class_weights(sources, len(settings.classes)))
        if checkpoint.exists():
            run.restore(checkpoint)
        elif base is not None:
            run.start_from(base, next(_batches(sources, settings, run.step)))
        with prefetch(_batches(sources, settings, run.step)) as batches:
            for batch in batches:
                loss = run.learn(batch)
                progress(run.step, loss)
                if run.step % CHECKPOINT == 0 or run.step == settings.steps:
                    run.save(checkpoint)
    return run.averaged.eval()


def _check(sources: Sequence[NetSource], settings: NetworkTrainingSettings) -> None:
    if not any((~sample.ignored).any() for source in sources for sample in source.samples):
        raise DataError("no picture has a vehicle; pass labelled pictures")
    names = {source.name for source in sources}
    if unknown := sorted(settings.weights.keys() - names):
        known = ", ".join(sorted(names))
        raise DataError(
            f"train.net.weights: no set of pictures is named {unknown[0]}; there are {known}"
        )


@contextmanager
def _fast_torch() -> Iterator[None]:
    """Use one thread and round the smallest numbers to 0, and undo both at the end."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)  # two threads that wait for each other are slower than one
    torch.set_flush_denormal(True)
    try:
        yield
    finally:
        torch.set_num_threads(threads)
        torch.set_flush_denormal(False)


class _Run:
    """The state of a training between two steps."""

    def __init__(
        self,
        settings: NetworkTrainingSettings,
        learnt_with: dict[str, Any],
        class_weights: Tensor,
    ) -> None:
        torch.manual_seed(_SEED)
        self._settings = settings
        self._learnt_with = learnt_with
        self._class_weights = class_weights
        self._network = Network(len(settings.classes)).to(memory_format=torch.channels_last).train()
        self.averaged = copy.deepcopy(self._network)
        weights = [parameter for parameter in self._network.parameters() if parameter.ndim > 1]
        others = [parameter for parameter in self._network.parameters() if parameter.ndim <= 1]
        groups = [{"params": weights}, {"params": others, "weight_decay": 0.0}]
        self._optimizer = torch.optim.AdamW(
            groups, settings.learning_rate, weight_decay=_WEIGHT_DECAY
        )
        self._parts = {
            "network": self._network,
            "averaged": self.averaged,
            "optimizer": self._optimizer,
        }
        self.step = 0

    def start_from(self, path: Path, batch: Batch) -> None:
        """Take the first weights from an exported network. Raises `DataError`."""
        start_from(self._network, path, batch.pictures, self._settings.classes)
        self.averaged.load_state_dict(self._network.state_dict())

    @property
    def rate(self) -> float:
        """The learning rate of the next step: it rises, stays, and falls as a cosine."""
        settings, step = self._settings, self.step
        warm_up = min(_WARM_UP, settings.steps // 10)
        if step < warm_up:
            return settings.learning_rate * (step + 1) / warm_up
        share = max(0.0, 2 * step / settings.steps - 1)  # of the second half
        low = _LAST_RATE
        return settings.learning_rate * (low + (1 - low) * (1 + math.cos(math.pi * share)) / 2)

    def learn(self, batch: Batch) -> float:
        """Do one step and return its loss."""
        for group in self._optimizer.param_groups:
            group["lr"] = self.rate
        loss = _loss(self._network, batch, self._class_weights)
        self._optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(self._network.parameters(), _LONGEST_GRADIENT)
        self._optimizer.step()
        self.step += 1
        self._average()
        return float(loss.detach())

    @torch.no_grad()
    def _average(self) -> None:
        keep = min(_AVERAGE, self.step / (self.step + 10))
        averages = self.averaged.state_dict()
        for name, value in self._network.state_dict().items():
            if value.dtype.is_floating_point:
                averages[name].lerp_(value, 1 - keep)

    def save(self, path: Path) -> None:
        """Write the state to a file."""
        parts = {name: part.state_dict() for name, part in self._parts.items()}
        with staged(path, overwrite=True) as temporary:
            torch.save({"settings": self._learnt_with, "step": self.step, **parts}, temporary)

    def restore(self, path: Path) -> None:
        """Resume from a file that `save` has written. Raises `DataError`."""
        try:
            state: dict[str, Any] = torch.load(path, weights_only=True)
            same = state["settings"] == self._learnt_with
            for name, part in self._parts.items():
                part.load_state_dict(state[name])
            self.step = state["step"]
        except Exception as error:  # torch raises many kinds for a file of another form
            raise DataError(f"{path}: is not a checkpoint of this training; remove it") from error
        if not same:
            others = "with other settings, other pictures or another base"
            raise DataError(f"{path}: belongs to a training {others}; remove it")


def class_weights(sources: Sequence[NetSource], count: int) -> Tensor:
    """Return the weight of each class in the loss, float32 `(count + 1,)`; rare ones have more.

    The last one is that of vehicles of unknown kind, 1. The most frequent class has 1 too.
    """
    found = np.zeros(count + 1)
    for sample in (sample for source in sources for sample in source.samples):
        found += np.bincount(sample.classes[~sample.ignored] % (count + 1), minlength=count + 1)
    weights = (found[:count].max() / np.maximum(found, 1)) ** _BALANCE
    return torch.tensor([*np.minimum(weights[:count], _MOST_WEIGHT), 1.0], dtype=torch.float32)


def _loss(network: Network, batch: Batch, weights: Tensor) -> Tensor:
    height, width = batch.pictures.shape[2:]
    centers, strides = cell_centers(height, width)
    raw = flatten(network(batch.pictures))
    scores, boxes = raw[..., 0], decode(raw[..., 1:5], centers, strides)
    row, cell, iou = assign(scores, boxes, batch.vehicles, centers, strides)
    cells = batch.vehicles.picture[row], cell
    targets = torch.zeros_like(scores)
    targets[cells] = iou
    classes = batch.vehicles.classes[row]
    counted = torch.ones_like(scores)
    counted[_uncounted(batch.ignored, centers, raw[..., 5:].detach().argmax(-1))] = 0
    counted[cells] = weights[classes].sqrt()
    whole = iou.sum().clamp(min=1)
    score_loss = (quality_focal_loss(scores, targets) * counted).sum() / whole
    box_loss = ((1 - giou(boxes[cells], batch.vehicles.boxes[row])) * iou).sum() / whole
    class_loss = functional.cross_entropy(
        raw[..., 5:][cells], classes, weights[:-1], ignore_index=UNKNOWN, reduction="sum"
    )
    return score_loss + BOX_WEIGHT * box_loss + CLASS_WEIGHT * class_loss / max(len(iou), 1)


def _uncounted(ignored: Vehicles, centers: Tensor, seen: Tensor) -> tuple[Tensor, Tensor]:
    """Return the picture and the cell of all cells whose middle lies in an ignore region.

    Of a region with a class, only the cells that see it: `seen` is the best class `(B, cells)`.
    """
    boxes = ignored.boxes[:, None]
    inside = ((centers > boxes[..., :2]) & (centers < boxes[..., 2:])).all(-1)
    classes = ignored.classes[:, None]
    inside &= (classes == UNKNOWN) | (classes == seen[ignored.picture])
    row, cell = torch.nonzero(inside, as_tuple=True)
    return ignored.picture[row], cell


def _to_batch(samples: Sequence[NetSample]) -> Batch:
    joined = join(samples, samples[0].image)
    counts = [len(sample.boxes) for sample in samples]
    picture = torch.repeat_interleave(torch.arange(len(samples)), torch.tensor(counts))
    boxes, classes = torch.from_numpy(joined.boxes).float(), torch.from_numpy(joined.classes)
    vehicles, ignored = (
        Vehicles(picture[rows], boxes[rows], classes[rows])
        for rows in map(torch.from_numpy, (~joined.ignored, joined.ignored))
    )
    pictures = torch.from_numpy(np.stack([sample.image for sample in samples]))
    return Batch(pictures.permute(0, 3, 1, 2).float(), vehicles, ignored)
