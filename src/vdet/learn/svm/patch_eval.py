"""How well the linear model separates patches of vehicles from others.

Without a ready model, one is trained without the last patches of each folder, and tested on these:
a split that leaks nothing, because patches in a row are near-duplicates.
"""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from vdet.boxes import BoolArray, Float64Array
from vdet.config.schema import Settings
from vdet.detect.svm.model import LinearModel
from vdet.evaluate.mistakes import Tile
from vdet.evaluate.output import RunName, share, table
from vdet.learn.svm.dataset import PatchFile, read_patches
from vdet.learn.svm.extraction import extract
from vdet.learn.svm.metrics import CONFUSION_HEADINGS, Classification, Rate
from vdet.learn.svm.training import fit_part
from vdet.pages.render import render
from vdet.progress import Steps, no_steps

THRESHOLD = 0.5
"""A patch with at least this probability is classified as a vehicle."""
MOST_MISTAKES = 24
"""Most mistakes of either kind that are shown."""

_SPLIT = "tail split: leak-free, a new model is tested on the last patches of each folder"
_READY = "if the model was trained on some of these patches, the scores are too good"


@dataclass(frozen=True, slots=True)
class WrongPatch:
    """A patch that is classified wrongly, and its probability of being a vehicle."""

    file: PatchFile
    probability: float


@dataclass(frozen=True, slots=True)
class PatchScores:
    """The metrics on the tested patches.

    Attributes
    ----------
    meaning
        Whether the model was trained on the tested patches.
    roc_auc, log_loss
        None if all tested patches are of one class.
    mistakes
        The worst missed vehicles and the worst false alarms, the worst first.
    """

    meaning: str
    test: Classification
    precision: Rate
    recall: Rate
    roc_auc: float | None
    log_loss: float | None
    mistakes: tuple[WrongPatch, ...]


def evaluate_patches(
    files: Sequence[PatchFile],
    settings: Settings,
    model: LinearModel | None = None,
    *,
    jobs: int | None = None,
    steps: Steps = no_steps,
) -> PatchScores:
    """Test a ready model on all patches, or train one and test it on those that were held out.

    Parameters
    ----------
    jobs
        Number of threads that describe patches; None: one for each core.
    steps
        Called at the start of each step, with the number of patches to describe or None.

    Raises
    ------
    DataError
        Patches are unreadable, or there are too few to train on.
    """
    files = [file for file in files if not file.is_boxed]
    if model:
        progress = steps("describing patches", len(files))
        training = settings.train.svm
        data = extract(
            files, model.features, training, augmented=False, jobs=jobs, progress=progress
        )
        tested, meaning = np.full(len(files), True), _READY
    else:
        data, tested, model = fit_part(files, settings, "tail", jobs=jobs, steps=steps)
        meaning = _SPLIT
    rows = np.flatnonzero(tested)
    probabilities = model.probabilities(data.vectors[data.patches[rows]]).astype(np.float64)
    return score_patches([files[row] for row in rows.tolist()], probabilities, meaning)


def score_patches(
    files: Sequence[PatchFile], probabilities: Float64Array, meaning: str
) -> PatchScores:
    """Compute the metrics of patches, at least one, and their probabilities, float64 `(n,)`."""
    from sklearn import metrics

    vehicle = np.array([file.vehicle for file in files])
    positive = probabilities >= THRESHOLD
    both = 0 < np.count_nonzero(vehicle) < len(vehicle)
    return PatchScores(
        meaning=meaning,
        test=Classification.of(vehicle, positive, np.array([file.group for file in files])),
        precision=Rate.of(vehicle[positive]),
        recall=Rate.of(positive[vehicle]),
        roc_auc=float(metrics.roc_auc_score(vehicle, probabilities)) if both else None,
        log_loss=float(metrics.log_loss(vehicle, probabilities)) if both else None,
        mistakes=tuple(
            WrongPatch(files[row], float(probabilities[row]))
            for row in _worst(vehicle, probabilities)
        ),
    )


def _worst(vehicle: BoolArray, probabilities: Float64Array) -> list[int]:
    """Return the rows of the worst missed vehicles and false alarms, the worst first."""
    error = np.where(vehicle, THRESHOLD - probabilities, probabilities - THRESHOLD)
    order = np.argsort(-error, kind="stable")
    wrong = order[((probabilities >= THRESHOLD) != vehicle)[order]]
    missed, alarms = (wrong[vehicle[wrong] == kind][:MOST_MISTAKES] for kind in (True, False))
    return [row for row in wrong.tolist() if row in missed or row in alarms]


def lines(scores: PatchScores) -> Iterator[str]:
    """Yield the scores as lines of text."""
    yield scores.meaning
    yield ""
    yield from table(("metric", "95 % interval"), metric_rows(scores))
    yield ""
    yield from scores.test.lines()


def metric_rows(scores: PatchScores) -> list[list[str]]:
    """Return the name of each metric and its value, as text."""
    return [
        ["patches tested", str(scores.test.patches)],
        ["accuracy", str(scores.test.accuracy)],
        ["precision", str(scores.precision)],
        ["recall", str(scores.recall)],
        ["ROC AUC", share(scores.roc_auc, 4)],
        ["log loss", share(scores.log_loss, 4)],
    ]


def values(scores: PatchScores) -> dict[str, Any]:
    """Return the scores as values for JSON."""
    mistakes = [asdict(each) | {"file": str(each.file)} for each in scores.mistakes]
    return asdict(scores) | {"mistakes": mistakes}


def patch_page(scores: PatchScores, run: RunName) -> str:
    """Return the page as HTML."""
    return render(
        "eval_patches.html",
        subtitle=run.line,
        scores=scores,
        metrics=metric_rows(scores),
        confusion_headings=CONFUSION_HEADINGS,
        missed=_tiles(scores, vehicle=True),
        alarms=_tiles(scores, vehicle=False),
    )


def _tiles(scores: PatchScores, *, vehicle: bool) -> list[Tile]:
    mistakes = [each for each in scores.mistakes if each.file.vehicle == vehicle]
    patches = read_patches([each.file for each in mistakes])
    return [
        Tile(patch.image, f"p = {mistake.probability:.3f}", str(mistake.file.name))
        for mistake, patch in zip(mistakes, patches, strict=True)
        if patch.image is not None
    ]
