"""A training run: from patch files to a model with its metrics."""

import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from vdet.boxes import BoolArray
from vdet.config.schema import Settings
from vdet.detect.svm.features import FeatureExtractor, to_patch
from vdet.detect.svm.model import LinearModel
from vdet.errors import DataError
from vdet.learn.svm.augmentation import augment
from vdet.learn.svm.box_regression import BoxPatches, extract_box_patches, fit_split_boxes
from vdet.learn.svm.dataset import PatchFile, read_patches
from vdet.learn.svm.extraction import LabelledVectors, SplitName, extract, hold_out
from vdet.learn.svm.fitting import fit
from vdet.learn.svm.metrics import Confusion, GroupAccuracy, SplitMetrics, TrainingMetrics
from vdet.progress import Steps, no_steps
from vdet.version import __version__
from vdet.workers import make_workers

_TIMED_PATCHES = 200


def train(
    files: Sequence[PatchFile],
    settings: Settings,
    *,
    boxed: Sequence[PatchFile] = (),
    jobs: int | None = None,
    scheduler: str | None = None,
    steps: Steps = no_steps,
) -> tuple[LinearModel, TrainingMetrics]:
    """Describe the patches, fit on the configured split, and on the other one for comparison.

    Parameters
    ----------
    boxed
        Patches of neither class with known box sides. If they or `files` have known sides, the
        model learns to find the sides of vehicles.
    jobs
        Processes, as joblib counts them: -1 for one per core.
    scheduler
        Address of a Dask scheduler whose workers describe the patches instead.
    steps
        Called at the start of each step, with the number of patches to describe or None.

    Returns
    -------
    The model fitted on the training part of `train.svm.split`, with its provenance, and the metrics
    of both splits, this one first.

    Raises
    ------
    DataError
        Too many patches are unreadable, too few are left to learn from, or a process was killed.
    ClusterError
        The cluster of `scheduler` cannot be used.
    """
    began = time.perf_counter()
    training = settings.train.svm
    workers = make_workers(jobs, scheduler)
    data = extract(
        files,
        settings.svm.features,
        training,
        workers=workers,
        augmenter=partial(augment, settings=training.augmentation),
        progress=steps("describing patches", len(files)),
    )
    boxes = extract_box_patches(files, boxed, settings, workers=workers, steps=steps)
    extract_seconds = time.perf_counter() - began
    names: list[SplitName] = ["random", "tail"]
    names.sort(key=lambda name: name != training.split)
    fitted = [_fit_split(data, boxes, settings, name, steps) for name in names]
    model = fitted[0][0]
    steps("timing the classifier", None)
    report = TrainingMetrics(
        vehicles=int(np.count_nonzero(data.vehicle)),
        non_vehicles=int(np.count_nonzero(~data.vehicle)),
        boxed=sum(file.sides is not None for file in (*files, *boxed)),
        broken=data.broken + (boxes.boxed.broken if boxes and boxes.boxed else 0),
        groups=dict(Counter(file.group for file in (*files, *boxed))),
        features=data.vectors.shape[1],
        extract_seconds=round(extract_seconds, 3),
        milliseconds_per_prediction=_milliseconds_per_prediction(model, files),
        splits=tuple(split for _, split in fitted),
    )
    provenance = {
        "program": f"vdet {__version__}",
        "data_sha256": data.digest,
        "training": training.model_dump(mode="json"),
        "report": asdict(report),
    }
    if boxes and boxes.boxed:
        provenance["boxes_sha256"] = boxes.boxed.digest
    return replace(model, provenance=provenance), report


def _fit_split(
    data: LabelledVectors,
    boxes: BoxPatches | None,
    settings: Settings,
    name: SplitName,
    steps: Steps,
) -> tuple[LinearModel, SplitMetrics]:
    def held_of(some: LabelledVectors) -> BoolArray:
        training = settings.train.svm
        return hold_out(some.groups, name, training.test_fraction, training.seed)

    held = held_of(data)
    if not held.any():
        raise DataError("no folder has two patches, of which one could be held out; give more")
    began = time.perf_counter()
    steps(f"fitting the classifier, {name} split", None)
    model = fit(data.rows.of(~held), settings)
    regression, error = None, None
    if boxes is not None:
        steps(f"fitting the sides of boxes, {name} split", None)
        regression, error = fit_split_boxes(data, boxes, held_of, settings)
    seconds = time.perf_counter() - began
    predicted = model.probabilities(data.vectors) >= 0.5
    right = predicted == data.vehicle
    return replace(model, box_regression=regression), SplitMetrics(
        split=name,
        train_patches=int(np.count_nonzero(~held)),
        train_augmented=int(np.count_nonzero(~held[data.rows.origins[len(held) :]])),
        test_patches=int(np.count_nonzero(held)),
        train_accuracy=float(right[~held].mean()),
        test_accuracy=float(right[held].mean()),
        confusion=Confusion.of(data.vehicle[held], predicted[held]),
        groups=_by_group(data.groups[held], right[held]),
        boxes=error,
        fit_seconds=round(seconds, 3),
    )


def _by_group(groups: npt.NDArray[np.str_], right: BoolArray) -> tuple[GroupAccuracy, ...]:
    return tuple(
        GroupAccuracy(name, int((groups == name).sum()), float(right[groups == name].mean()))
        for name in np.unique(groups).tolist()
    )


def _milliseconds_per_prediction(model: LinearModel, files: Sequence[PatchFile]) -> float:
    """Return the median time to describe and score a patch."""
    extractor = FeatureExtractor(model.features)
    some = files[:: max(1, len(files) // _TIMED_PATCHES)]
    times = []
    for patch in read_patches(some):
        if patch.image is not None:
            image = to_patch(patch.image, model.features.patch)
            began = time.perf_counter()
            model.probabilities(extractor.describe(image)[np.newaxis])
            times.append(time.perf_counter() - began)
    return round(1000 * float(np.median(times)), 4)
