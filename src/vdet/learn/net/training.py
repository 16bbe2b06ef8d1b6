"""The training of the network: steps, learning rate, moving average, checkpoints."""

import copy
import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch

from vdet.boxes import BoolArray
from vdet.config.schema import NetworkTrainingSettings
from vdet.detect.onnx.network import Header, Session, read_header
from vdet.errors import DataError
from vdet.files import staged
from vdet.learn.net.augmentation import ImageDrawing, SampleDrawer
from vdet.learn.net.network import (
    Batch,
    Network,
    Vehicles,
    class_weights,
    export_network,
    loss_of,
    start_from,
)
from vdet.learn.net.sources import NetSample, NetSource, join
from vdet.version import __version__
from vdet.workers import SearchThreads, core_count

CHECKPOINT = 500
"""Steps between two checkpoints."""
_SEED = 0
"""Seed of the weights and the images."""
_SMALL = 0.8
"""Fraction of the steps, at the start, with images of half the size."""
_PLAIN = 0.12
"""Fraction of the steps, at the end, without mosaics."""
_MOSAICS = 0.35
"""Fraction of images that are mosaics of four."""
_WARM_UP = 200
"""Steps in which the learning rate rises, at the start and after a stop, or a tenth of all if that
is less."""
_CONSTANT = 2 / 3
"""Fraction of the steps after which the learning rate falls."""
_LAST_RATE = 0.02
"""Last learning rate, as a fraction of the highest."""
_WEIGHT_DECAY = 0.02
_LONGEST_GRADIENT = 10.0
_AVERAGE = 0.998
"""Fraction that the moving average of the weights keeps at each step."""
_MAGNIFIED = 1.4  # scale of the small images, whose vehicles would be too small

StepProgress = Callable[[int, float], object]
"""Called after each step, with the number of steps so far and the loss."""


def train_to_file(
    sources: Sequence[NetSource],
    settings: NetworkTrainingSettings,
    output: Path,
    *,
    base: Path | None = None,
    device: str = "auto",
    overwrite: bool = False,
    progress: StepProgress = lambda *_: None,
) -> None:
    """Train a network, write it, and remove the checkpoint, a file beside it that ends in .ckpt.

    Parameters
    ----------
    sources, settings, base, device, progress
        See `train_network`.
    overwrite
        Replace an earlier network.

    Raises
    ------
    ModelError
        The base cannot be read.
    DataError
        See `train_network`.
    OutputError
        A file cannot be written.
    """
    checkpoint = output.with_suffix(".ckpt")
    before = read_header(Session(base)) if base else None
    network = train_network(
        sources, settings, checkpoint, base=base, device=device, progress=progress
    )
    provenance = {
        "program": f"vdet {__version__}",
        "training": settings.model_dump(mode="json"),
        "report": {"sources": [source.report for source in sources]},
        **({"base": before.provenance} if before else {}),
    }
    pixels = settings.size[0] * settings.size[1]
    header = Header(classes=settings.classes, pixels=pixels, provenance=provenance)
    export_network(network, header, output, overwrite=overwrite)
    checkpoint.unlink(missing_ok=True)


def train_network(
    sources: Sequence[NetSource],
    settings: NetworkTrainingSettings,
    checkpoint: Path,
    *,
    base: Path | None = None,
    device: str = "auto",
    progress: StepProgress = lambda *_: None,
) -> Network:
    """Train a network and return it with the moving average of its weights.

    On a CPU the same sources and settings give the same network on the same machine. A training
    run that was stopped resumes from its last checkpoint, also on another machine or device. torch
    computes on all cores; threads draw the images: one for a CPU, one per core for a GPU.

    Parameters
    ----------
    sources
        At least one, each with at least one sample.
    checkpoint
        File of the last checkpoint; it is made and replaced, and read where it exists. It has the
        moving average of the weights in half precision, and the number of steps.
    base
        An exported network whose weights are the first ones.
    device
        Where to compute: "cpu", "cuda", or "auto" for a GPU where torch finds one.

    Raises
    ------
    DataError
        There is no such device, no source has a vehicle, a weight is given to a source that is not
        there, the base is not such a network, or the checkpoint belongs to another training run.
    """
    if not any((~sample.ignored).any() for source in sources for sample in source.samples):
        raise DataError("no image has a vehicle; pass labelled images")
    names = sorted(source.name for source in sources)
    if unknown := sorted(settings.weights.keys() - names):
        raise DataError(
            f"train.net.weights: unknown set {unknown[0]}; there are {', '.join(names)}"
        )
    learnt_with = {
        "sources": [(source.name, len(source.samples)) for source in sources],
        "base": base.name if base else None,
        **settings.model_dump(),
    }
    target = _device(device)
    torch.set_num_threads(core_count())
    draw = partial(_draw_batch, SampleDrawer(sources, settings), settings)
    torch.set_flush_denormal(True)
    try:
        training = _Training(sources, settings, learnt_with, target)
        if checkpoint.exists():
            training.restore(checkpoint)
        elif base is not None:
            training.start_from(base, draw(0))
        workers = 1 if target.type == "cpu" else core_count()
        remaining_steps = range(training.step, settings.steps)
        with SearchThreads(workers) as pool:
            for _, batch in pool.map_ordered(draw, remaining_steps):
                loss = training.learn(batch)
                progress(training.step, loss)
                if training.step % CHECKPOINT == 0 or training.step == settings.steps:
                    training.save(checkpoint)
    finally:
        torch.set_flush_denormal(False)
    return training.averaged.cpu().eval()


def _device(name: str) -> torch.device:
    """Return a device by the name of an option. Raises `DataError` if torch does not find it."""
    has_gpu = torch.cuda.is_available()
    if name == "cuda" and not has_gpu:
        raise DataError("--device cuda: torch finds no GPU; use --device cpu")
    return torch.device("cuda" if has_gpu and name != "cpu" else "cpu")


def _draw_batch(drawer: SampleDrawer, settings: NetworkTrainingSettings, step: int) -> Batch:
    """Draw the images of a step, which depend on the step and the seed alone.

    Several threads may call this at once.
    """
    rng, drawing = np.random.default_rng((_SEED, step)), _drawing(settings, step)
    return _to_batch([drawer.draw(rng, drawing) for _ in range(settings.batch)])


def _drawing(settings: NetworkTrainingSettings, step: int) -> ImageDrawing:
    width, height = settings.size
    mosaics = 0.0 if step >= (1 - _PLAIN) * settings.steps else _MOSAICS
    if step < _SMALL * settings.steps:
        return ImageDrawing(width // 2, height // 64 * 32, _MAGNIFIED, mosaics)
    return ImageDrawing(width, height, 1.0, mosaics)


def _to_batch(samples: Sequence[NetSample]) -> Batch:
    joined = join(samples, samples[0].image)
    image = np.repeat(np.arange(len(samples)), [len(sample.boxes) for sample in samples])

    def vehicles(rows: BoolArray) -> Vehicles:
        return Vehicles(
            image=torch.from_numpy(image[rows]),
            boxes=torch.from_numpy(joined.boxes[rows]),
            classes=torch.from_numpy(joined.classes[rows]),
        )

    images = torch.from_numpy(np.stack([sample.image for sample in samples]))
    return Batch(
        images=images.permute(0, 3, 1, 2),
        vehicles=vehicles(~joined.ignored),
        ignored=vehicles(joined.ignored),
    )


class _Training:
    """The state of a training run between two steps."""

    def __init__(
        self,
        sources: Sequence[NetSource],
        settings: NetworkTrainingSettings,
        learnt_with: dict[str, Any],
        device: torch.device,
    ) -> None:
        torch.manual_seed(_SEED)
        self._settings = settings
        self._learnt_with = learnt_with
        self._device = device
        self._class_weights = class_weights(sources, len(settings.classes)).to(device)
        network = Network(len(settings.classes), settings.channels)
        self._network = network.to(device, memory_format=torch.channels_last).train()
        self.averaged = copy.deepcopy(self._network)
        weights = [parameter for parameter in self._network.parameters() if parameter.ndim > 1]
        biases = [parameter for parameter in self._network.parameters() if parameter.ndim <= 1]
        self._optimizer = torch.optim.AdamW(
            [{"params": weights}, {"params": biases, "weight_decay": 0.0}],
            settings.learning_rate,
            weight_decay=_WEIGHT_DECAY,
        )
        self.step = 0
        self._resumed_at = 0

    def start_from(self, path: Path, batch: Batch) -> None:
        """Take the first weights from an exported network. Raises `DataError`."""
        images = batch.to(self._device).images
        start_from(self._network, path, images, self._settings.classes)
        self.averaged.load_state_dict(self._network.state_dict())

    @property
    def rate(self) -> float:
        """The learning rate of the next step: it rises, stays, and falls as a cosine."""
        settings = self._settings
        warm_up = max(1, min(_WARM_UP, settings.steps // 10))
        rise = min(1.0, (self.step - self._resumed_at + 1) / warm_up)
        fraction = max(0.0, (self.step / settings.steps - _CONSTANT) / (1 - _CONSTANT))
        fall = (1 + math.cos(math.pi * fraction)) / 2
        return settings.learning_rate * rise * (_LAST_RATE + (1 - _LAST_RATE) * fall)

    def learn(self, batch: Batch) -> float:
        """Do one step and return its loss."""
        for group in self._optimizer.param_groups:
            group["lr"] = self.rate
        loss = loss_of(self._network, batch.to(self._device), self._class_weights)
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
        """Write the averaged weights and the number of steps to a file."""
        averaged = {
            name: value.half() if value.ndim > 1 else value
            for name, value in self.averaged.state_dict().items()
        }
        state = {"settings": self._learnt_with, "step": self.step, "averaged": averaged}
        with staged(path, overwrite=True) as temporary:
            torch.save(state, temporary)

    def restore(self, path: Path) -> None:
        """Resume from the weights of a file that `save` has written. Raises `DataError`.

        The optimizer starts anew, so the learning rate rises again.
        """
        try:
            state: dict[str, Any] = torch.load(path, self._device, weights_only=True)
            same = state["settings"] == self._learnt_with
            for network in (self._network, self.averaged):
                network.load_state_dict(state["averaged"])
            self.step = self._resumed_at = state["step"]
        except Exception as error:  # torch raises many kinds for a file of another form
            raise DataError(
                f"{path}: is not a checkpoint of this training run; remove it"
            ) from error
        if not same:
            differing = "other settings, images or base"
            raise DataError(f"{path}: belongs to a training run with {differing}; remove it")
