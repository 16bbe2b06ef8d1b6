"""A training run: from patch files to a model with its metrics."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, replace

import numpy as np

from vdet.boxes import BoolArray
from vdet.config.schema import Settings
from vdet.detect.svm.model import LinearModel
from vdet.errors import DataError
from vdet.learn.svm.box_regression import fit_boxes
from vdet.learn.svm.dataset import PatchFile
from vdet.learn.svm.extraction import LabelledVectors, SplitName, extract, hold_out
from vdet.learn.svm.fitting import fit
from vdet.learn.svm.metrics import Classification, TrainingMetrics
from vdet.progress import Steps, no_steps
from vdet.version import __version__


def train(
    files: Sequence[PatchFile],
    settings: Settings,
    *,
    jobs: int | None = None,
    steps: Steps = no_steps,
) -> tuple[LinearModel, TrainingMetrics]:
    """Describe the patches, fit a model on a part of them, and test it on the others.

    Parameters
    ----------
    files
        If some have known sides, the model learns to find the sides of vehicles.
    jobs
        Number of threads that describe patches; None: one for each core.
    steps
        Called at the start of each step, with the number of patches to describe or None.

    Returns
    -------
    The model fitted on the training part of `train.svm.split`, with its provenance, and its
    metrics.

    Raises
    ------
    DataError
        Patches are unreadable, or there are too few to learn from.
    """
    training, features = settings.train.svm, settings.svm.features
    boxed = [file for file in files if file.is_boxed]
    of_classes = [file for file in files if not file.is_boxed]
    data, held, model = fit_part(of_classes, settings, training.split, jobs=jobs, steps=steps)
    progress = steps("describing patches with boxes", len(boxed))
    without_parts = training.augmentation.model_copy(update={"parts": 0.0})  # they have no sides
    of_sides = training.model_copy(update={"augmentation": without_parts})
    of_boxed = extract(boxed, features, of_sides, jobs=jobs, progress=progress)
    steps("fitting the sides of boxes", None)
    regression, box_error = fit_boxes(
        (data, of_boxed),
        lambda each: hold_out(each.groups, training.split, training.seed),
        features,
    )
    predicted = model.probabilities(data.vectors[data.patches]) >= 0.5
    metrics = TrainingMetrics(
        vehicles=int(np.count_nonzero(data.labels)),
        non_vehicles=int(np.count_nonzero(~data.labels)),
        boxed=sum(file.sides is not None for file in files),
        groups=dict(Counter(file.group for file in (*of_classes, *boxed))),
        features=features.length,
        split=training.split,
        train_patches=int(np.count_nonzero(~held)),
        train_augmented=int(np.count_nonzero(~held[data.origins]) - np.count_nonzero(~held)),
        train_accuracy=float((predicted == data.labels)[~held].mean()),
        test=Classification.of(data.labels[held], predicted[held], data.groups[held]),
        box_error=box_error,
    )
    provenance = {
        "program": f"vdet {__version__}",
        "data_sha256": data.digest,
        "boxes_sha256": of_boxed.digest,
        "training": training.model_dump(mode="json"),
        "report": asdict(metrics),
    }
    return replace(model, provenance=provenance, box_regression=regression), metrics


def fit_part(
    files: Sequence[PatchFile],
    settings: Settings,
    split: SplitName,
    *,
    jobs: int | None,
    steps: Steps,
) -> tuple[LabelledVectors, BoolArray, LinearModel]:
    """Describe patches of both classes and fit a model to those that `split` does not hold out.

    Returns
    -------
    The patches, which of them are held out, bool `(patches,)`, and the model.
    """
    training = settings.train.svm
    progress = steps("describing patches", len(files))
    data = extract(files, settings.svm.features, training, jobs=jobs, progress=progress)
    held = hold_out(data.groups, split, training.seed)
    if not held.any():
        raise DataError("no folder has two patches, of which one could be held out; give more")
    steps("fitting the classifier", None)
    return data, held, fit(data.of(~held), settings)
