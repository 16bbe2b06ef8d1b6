"""A training run: from patch files to a model with its metrics."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import partial

import numpy as np

from vdet.boxes import BoolArray
from vdet.config.schema import Settings
from vdet.detect.svm.model import LinearModel
from vdet.errors import DataError
from vdet.learn.svm.augmentation import augment
from vdet.learn.svm.box_regression import extract_box_patches, fit_split_boxes
from vdet.learn.svm.dataset import PatchFile
from vdet.learn.svm.extraction import LabelledVectors, extract, hold_out
from vdet.learn.svm.fitting import fit
from vdet.learn.svm.metrics import Classification, TrainingMetrics
from vdet.progress import Steps, no_steps
from vdet.version import __version__
from vdet.workers import make_workers


def train(
    files: Sequence[PatchFile],
    settings: Settings,
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
    steps: Steps = no_steps,
) -> tuple[LinearModel, TrainingMetrics]:
    """Describe the patches, fit a model on a part of them, and test it on the others.

    Parameters
    ----------
    files
        If some have known sides, the model learns to find the sides of vehicles.
    jobs
        Number of processes; None: one for each core.
    scheduler
        Address of a Dask scheduler whose workers describe the patches instead.
    steps
        Called at the start of each step, with the number of patches to describe or None.

    Returns
    -------
    The model fitted on the training part of `train.svm.split`, with its provenance, and its
    metrics.

    Raises
    ------
    DataError
        Too many patches are unreadable, too few are left to learn from, or a process was killed.
    ClusterError
        The cluster of `scheduler` cannot be used.
    """
    training = settings.train.svm
    workers = make_workers(jobs, scheduler)
    boxed = [file for file in files if file.is_boxed]
    of_classes = [file for file in files if not file.is_boxed]
    data = extract(
        of_classes,
        settings.svm.features,
        training,
        workers=workers,
        augmenter=partial(augment, settings=training.augmentation),
        progress=steps("describing patches", len(of_classes)),
    )
    boxes = extract_box_patches(of_classes, boxed, settings, workers=workers, steps=steps)

    def held_of(some: LabelledVectors) -> BoolArray:
        return hold_out(some.groups, training.split, training.seed)

    held = held_of(data)
    if not held.any():
        raise DataError("no folder has two patches, of which one could be held out; give more")
    steps("fitting the classifier", None)
    model = fit(data.of(~held), settings)
    regression, box_error = None, None
    if boxes is not None:
        steps("fitting the sides of boxes", None)
        regression, box_error = fit_split_boxes(data, boxes, held_of, settings)
    predicted = model.probabilities(data.vectors[data.patches]) >= 0.5
    metrics = TrainingMetrics(
        vehicles=int(np.count_nonzero(data.labels)),
        non_vehicles=int(np.count_nonzero(~data.labels)),
        boxed=sum(file.sides is not None for file in files),
        broken=len(files) - len(data.files) - (len(boxes.boxed.files) if boxes else len(boxed)),
        groups=dict(Counter(file.group for file in (*of_classes, *boxed))),
        features=data.vectors.shape[1],
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
        "training": training.model_dump(mode="json"),
        "report": asdict(metrics),
    }
    if boxes and boxed:
        provenance["boxes_sha256"] = boxes.boxed.digest
    return replace(model, provenance=provenance, box_regression=regression), metrics
