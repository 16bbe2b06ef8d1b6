"""`vdet adapt`: from footage of one camera to a linear model that knows it."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from pathlib import Path

import numpy as np

import vdet
from vdet.config.schema import AdaptSettings, CameraSearch, Settings
from vdet.detect.protocol import DetectorModel
from vdet.detect.svm.model import LinearModel
from vdet.errors import TruthError
from vdet.evaluate.labelled_video import LabelledVideo
from vdet.geometry import Float64Array
from vdet.learn.adapt.check import check
from vdet.learn.adapt.footage import WatchedClip, watch
from vdet.learn.adapt.report import AdaptReport, CheckReport, ClipReport, RoundReport, f1_against
from vdet.learn.adapt.rounds import Lesson, learn_in_rounds
from vdet.learn.adapt.student import between
from vdet.learn.adapt.windows import fit_windows
from vdet.learn.mining.choosing import cut_sides
from vdet.pipeline.loop import Steps, no_steps
from vdet.workers import make_workers


@dataclass(frozen=True, slots=True)
class AdaptJob:
    """The footage to learn.

    Attributes
    ----------
    clips
        Videos of one camera.
    seconds
        How much of each clip is watched; None for all of it.
    truths
        Labels of the clips, in the same order, for the check; () for none. Without a teacher, the
        model learns them.
    """

    clips: tuple[Path, ...]
    seconds: Fraction | None = None
    truths: tuple[LabelledVideo, ...] = ()


@dataclass(frozen=True, slots=True)
class NamedDetector:
    """A detector, and how reports name it."""

    name: str
    model: DetectorModel


def adapt_model(
    job: AdaptJob,
    base: LinearModel,
    teacher: NamedDetector | None,
    settings: Settings,
    *,
    threads: int,
    jobs: int | None = None,
    steps: Steps = no_steps,
) -> tuple[LinearModel, AdaptReport]:
    """Let a teacher watch the footage, and let the linear model `base` learn what it finds.

    Parameters
    ----------
    threads
        Threads of the teacher's search.
    jobs
        Processes that describe patches, as joblib counts them; None for one a core.

    Raises
    ------
    VideoError
        A clip cannot be read or searched.
    TruthError
        A truth has nothing about the frames kept back.
    DataError
        The teacher finds too few vehicles to learn from.
    """
    began = time.monotonic()
    clips = []
    for path in job.clips:
        progress = partial(steps, f"watching {path.name}")
        model = teacher.model if teacher else None
        clips.append(
            watch(path, model, settings, seconds=job.seconds, threads=threads, progress=progress)
        )
    for truth, clip in zip(job.truths, clips, strict=bool(job.truths)):
        _check_covered(truth, clip)
    if teacher:
        lessons = [Lesson(clip, clip.labels(settings)) for clip in clips]
    else:
        lessons = [Lesson(*each) for each in zip(clips, job.truths, strict=True)]
    perspective = fit_windows(
        np.concatenate([_whole_vehicles(each) for each in lessons]),
        (clips[0].width, clips[0].height),
        settings.svm.search.perspective,
        clips[0].horizon,
    )
    camera = CameraSearch(probability=settings.svm.search.probability, perspective=perspective)
    start = replace(base, camera=camera)
    rounds = learn_in_rounds(start, lessons, settings, workers=make_workers(jobs), steps=steps)
    learnt = _candidates(start, rounds[-1].model, camera, settings.adapt)
    checks = check(
        *(clips, job.truths, {"base": base, **learnt}, settings, steps), taught=teacher is not None
    )
    best = choose(checks, tuple(learnt), tolerance=settings.adapt.tolerance)
    adapted = learnt[best]
    assert adapted.camera is not None
    report = AdaptReport(
        clips=tuple(
            ClipReport(c.path.name, c.sha256, c.learnt, len(c.frames) - c.learnt) for c in clips
        ),
        teacher=teacher.name if teacher else "the truth",
        vehicles=sum(int(np.count_nonzero(~each.labels.ignored)) for each in lessons),
        camera=adapted.camera,
        rounds=tuple(RoundReport(r.vehicles, r.non_vehicles, r.boxes) for r in rounds),
        checks=checks,
        chosen=best,
        seconds=round(time.monotonic() - began, 1),
    )
    return replace(adapted, provenance=_provenance(report, base, settings)), report


def _candidates(
    start: LinearModel, learnt: LinearModel, camera: CameraSearch, settings: AdaptSettings
) -> dict[str, LinearModel]:
    """Return models with all or a part of what was learnt, and with more or fewer hits."""
    return {
        f"{share:g} of the change, hits from {probability:g}": replace(
            between(start, learnt, share),
            camera=camera.model_copy(update={"probability": probability}),
        )
        for probability in settings.probabilities
        for share in settings.shares
    }


def _check_covered(truth: LabelledVideo, clip: WatchedClip) -> None:
    kept_back = clip.frames[clip.learnt :]
    if kept_back and truth.last_frame < kept_back[0].number:
        raise TruthError(
            f"{clip.path}: its truth covers the frames up to {truth.last_frame}, the check begins "
            f"with {kept_back[0].number}; give --minutes, or more labels"
        )


def choose(checks: Sequence[CheckReport], names: Sequence[str], *, tolerance: float) -> str:
    """Return the first name whose F1 against what was learnt is about the highest.

    It is above that of the base, if any is.
    """
    f1 = f1_against(checks, checks[0].against)
    highest = max(f1[name] for name in names)
    near = (name for name in names if f1[name] >= highest - tolerance)
    return next(name for name in near if f1[name] > f1["base"] or f1[name] == highest)


def _whole_vehicles(lesson: Lesson) -> Float64Array:
    """Return the boxes of the vehicles that no side of the frame cuts off."""
    boxes = lesson.labels.boxes[~lesson.labels.ignored]
    width, height = lesson.clip.width, lesson.clip.height
    whole = [
        not cut_sides(box, width).any() and box[1] > 0 and box[1] + box[3] < height for box in boxes
    ]
    return boxes[np.array(whole, np.bool_)]


def _provenance(report: AdaptReport, base: LinearModel, settings: Settings) -> dict[str, object]:
    """Return what the header of the model says of its origin, as JSON values."""
    return {
        "program": f"vdet {vdet.__version__}",
        "adapt": settings.adapt.model_dump(mode="json"),
        "report": {"groups": _groups(report.clips, base), **report.values()},
        "base": base.provenance,
    }


def _groups(clips: Sequence[ClipReport], base: LinearModel) -> list[str]:
    """Return the names of all that the model has learnt from."""
    known = base.provenance.get("report", {}).get("groups", [])
    return [*known, *(clip.name for clip in clips)]
