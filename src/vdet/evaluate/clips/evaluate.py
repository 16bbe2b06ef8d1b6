"""Scores of labelled videos under one or several settings."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from vdet.evaluate.clips.clip import Clip, Variant, find_tracks
from vdet.evaluate.comparison import Comparison, compare, pool
from vdet.evaluate.matching import match
from vdet.evaluate.mistakes import Mistake, mistakes
from vdet.evaluate.scores import Scores, score_comparison
from vdet.evaluate.timelines import Timeline, timelines
from vdet.labels.reading import read_predictions, read_truth
from vdet.labels.roles import DEFAULT_ROLES, Roles
from vdet.labels.video import LabelledVideo
from vdet.lanes.road import LaneRequest
from vdet.progress import Progress, no_progress
from vdet.run.sinks.protocol import Output


@dataclass(frozen=True, slots=True, eq=False)
class ClipResult:
    """The scores of one video under one of the settings.

    `name` stands in tables; `video` is the file, None where a file of tracks is scored. The frames
    up to `until`, counted from 1, are compared. `left_out` boxes were found in later ones.
    """

    name: str
    video: Path | None
    comparison: Comparison
    scores: Scores
    mistakes: tuple[Mistake, ...]
    timelines: tuple[Timeline, ...]
    until: int
    left_out: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class RunResult:
    """The scores of all videos under one of the settings, and their total.

    `assignments` are those in which these settings differ from the others, as `--set` takes them.
    """

    assignments: tuple[str, ...]
    clips: tuple[ClipResult, ...]
    total: Scores


def evaluate_clips(
    clips: Sequence[Clip],
    variants: Sequence[Variant],
    progress: Progress = no_progress,
    *,
    outputs: Sequence[Output] = (),
    lanes: LaneRequest | None = None,
    overwrite: bool = False,
) -> list[RunResult]:
    """Find the vehicles in every clip, in one pass for all settings, and score each.

    Parameters
    ----------
    progress
        As `find_tracks` takes it, called for each clip.
    outputs
        Outputs that get the results; only with one clip and one variant.
    lanes
        If it is given, the lane is found too, for the outputs.
    overwrite
        Replace outputs that are there.

    Raises
    ------
    VideoError, TruthError, OutputError
        As `find_tracks`.
    """
    find = partial(
        find_tracks, variants=variants, progress=progress, lanes=lanes, overwrite=overwrite
    )
    found = [find(clip, outputs=outputs) for clip in clips]
    results = []
    for number, variant in enumerate(variants):
        of_clips = [
            score_video(str(clip.video), *each[number], video=clip.video)
            for clip, each in zip(clips, found, strict=True)
        ]
        results.append(RunResult(variant.assignments, tuple(of_clips), total(of_clips)))
    return results


def score_video(
    name: str,
    prediction: LabelledVideo,
    truth: LabelledVideo,
    *,
    video: Path | None = None,
    rate: float | None = None,
) -> ClipResult:
    """Score the predictions for a video and list their errors; arguments as in `compare`."""
    comparison = compare(prediction, truth, rate=rate)
    matched = match(comparison)
    return ClipResult(
        name,
        video,
        comparison,
        score_comparison(comparison),
        tuple(mistakes(comparison, matched)),
        tuple(timelines(comparison, matched)),
        max(prediction.last_frame, truth.last_frame),
    )


def score_files(
    prediction: Path,
    truth: Path,
    roles: Roles = DEFAULT_ROLES,
    *,
    until: int | None = None,
    rate: float | None = None,
) -> RunResult:
    """Score a file of tracks against a file of truth.

    Parameters
    ----------
    roles
        What the labels of the truth mean.
    until
        Number of the last frame to use, from 1; None: the last that the truth covers.
    rate
        As `compare` takes it.

    Raises
    ------
    TruthError
        A file cannot be used.
    """
    found, true = read_predictions(prediction), read_truth(truth, roles)
    last = until or true.last_frame
    compared = found.until(last)
    result = score_video(str(prediction), compared, true.until(last), rate=rate)
    result = replace(result, until=last, left_out=len(found) - len(compared))
    return RunResult((), (result,), result.scores)


def total(clips: Sequence[ClipResult]) -> Scores:
    """Return the scores of all clips taken as one."""
    return score_comparison(pool([clip.comparison for clip in clips]))


def best(runs: Sequence[RunResult]) -> RunResult:
    """Return the run with the highest F1, the first of equal ones."""
    return max(runs, key=lambda run: run.total.f1)
