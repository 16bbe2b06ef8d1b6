"""The linear model that learns patches of one camera, and stays close to what it was."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from vdet.config.schema import Settings
from vdet.detect.svm.features import Layout
from vdet.detect.svm.model import BoxRegression, LinearModel
from vdet.learn.augmentation import augment
from vdet.learn.box_regression import BoxRows, fit_sides, with_sides
from vdet.learn.dataset import PatchFile, find_boxed, find_patches
from vdet.learn.extraction import LabelledVectors, extract
from vdet.learn.fitting import learn_more
from vdet.learn.training_set import training_set
from vdet.pipeline.loop import Steps, no_steps
from vdet.workers import Workers


@dataclass(frozen=True, slots=True)
class Learnt:
    """A model, and the number of patches of each kind that it has learnt."""

    model: LinearModel
    vehicles: int
    non_vehicles: int
    boxes: int


def between(base: LinearModel, learnt: LinearModel, share: float) -> LinearModel:
    """Return `learnt` with this share of its change of the weights of `base`.

    With half of it, a model finds nearly as much on the new road, and forgets less of others.
    Source: Wortsman et al., "Robust Fine-tuning of Zero-shot Models", 2022.
    """
    kept = np.float32(1 - share)
    return replace(
        learnt,
        weights=learnt.weights + kept * (base.weights - learnt.weights),
        biases=learnt.biases + kept * (base.biases - learnt.biases),
    )


def learn(
    base: LinearModel,
    sources: Sequence[Path],
    settings: Settings,
    *,
    workers: Workers,
    steps: Steps = no_steps,
) -> Learnt:
    """Let the model `base` learn patches of one camera.

    Raises
    ------
    DataError
        There are too few patches of a class, or a worker process was killed.
    """
    training = settings.training.model_copy(
        update={"C": settings.training.C * settings.adapt.weight}
    )

    def describe(files: Sequence[PatchFile], step: str) -> LabelledVectors:
        return extract(
            files,
            base.features,
            max_broken=0,
            augmenter=partial(augment, settings=training.augmentation),
            seed=training.seed,
            workers=workers,
            progress=steps(step, len(files)),
        )

    files, boxed = find_patches(sources), find_boxed(sources)
    data = describe(files, "describing patches")
    sets = [data, describe(boxed, "describing patches with boxes")] if boxed else [data]
    steps("fitting", None)
    model = _fit_sides(base, sets, settings.adapt.penalty)
    samples = training_set(data, np.ones(len(files), np.bool_))
    fitted = learn_more(base, samples.vectors, samples.vehicle, training)
    fitted = replace(fitted, box_regression=model)
    vehicles = sum(file.vehicle for file in files)
    return Learnt(fitted, vehicles, len(files) - vehicles, len(boxed))


def _fit_sides(
    base: LinearModel, sets: Sequence[LabelledVectors], penalty: float
) -> BoxRegression | None:
    length = Layout.of(base.features).hog_length
    rows = []
    for each in sets:
        samples = with_sides(each, np.ones(len(each.vehicle), np.bool_))
        rows.append(BoxRows(samples.vectors[:, :length], samples.sides))
    return fit_sides(rows, penalty, base.box_regression)
