"""Scores of labelled videos."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from vdet.config.schema import Settings
from vdet.detect.protocol import DetectorModel
from vdet.evaluate.comparison import Comparison, compare, pool
from vdet.evaluate.scores import Scores, score_comparison
from vdet.findings import warnings_in
from vdet.labels.label import Label, SavedTracks
from vdet.labels.reading import read_tracks, read_truth
from vdet.labels.roles import Roles
from vdet.progress import Progress, no_progress
from vdet.regions import Regions
from vdet.run.loop import Parts
from vdet.run.video import Results, Run

_log = logging.getLogger("vdet")

_DEFAULT = Settings()


@dataclass(frozen=True, eq=False)
class ClipResult:
    """One video compared with its ground truth, or several videos pooled.

    `name` is shown in tables; `video` is the file, None if a file of tracks is scored. Frames up to
    `until`, counted from 1, are compared.
    """

    name: str
    comparison: Comparison
    until: int = 0
    video: Path | None = None

    @cached_property
    def scores(self) -> Scores:
        """All metrics."""
        return score_comparison(self.comparison)


def total(clips: Sequence[ClipResult]) -> ClipResult:
    """Return the pooled result of all videos."""
    return ClipResult("total", pool([clip.comparison for clip in clips]))


def score_files(
    prediction: Path, truth_path: Path, until: int | None = None, settings: Settings = _DEFAULT
) -> ClipResult:
    """Score a file of tracks against a file of ground truth.

    Parameters
    ----------
    until
        Number of the last frame to use, from 1; None: the last that the truth covers.
    settings
        For the classes to detect, and the roles of labels.

    Raises
    ------
    TruthError
        A file cannot be used.
    """
    tracks = read_tracks(prediction)
    for finding in warnings_in(tracks.findings):
        _log.warning("%s: %s", prediction, finding)
    truth = read_truth(truth_path, Roles.from_settings(settings))
    end = until or truth.length
    return ClipResult(str(prediction), compare(tracks.until(end), truth.until(end)), end)


def evaluate_video(
    video: Path,
    truth: SavedTracks,
    settings: Settings,
    model: DetectorModel,
    *,
    progress: Progress = no_progress,
    until: int | None = None,
) -> ClipResult:
    """Find the vehicles in a video with `vdet.run.video.Results`, and score them.

    True vehicles outside the regions are ignored.

    Parameters
    ----------
    truth
        Its ground truth; later frames are not read.
    model
        The detector of the settings.
    progress
        Called once, for the progress.
    until
        Number of the last frame to use, from 1; None: the last that the truth covers.

    Raises
    ------
    VideoError
        The video cannot be read or searched.
    TruthError
        The truth covers frames beyond the end of the video.
    """
    all_classes = settings.model_copy(update={"classes": ()})
    run = Run(video, settings=all_classes, frames=until or truth.length or None)
    labels, frames = list[Label](), 0
    truth = truth.until(until) if until else truth
    with Results(run, Parts(model), with_traffic=False) as results:
        advance, info = progress("", results.reader.expected), results.reader.info
        for result in results:
            labels += [
                Label(replace(track, box=track.box.rounded), frame=result.frame.index)
                for track in result.tracks
            ]
            frames += 1
            advance(1)
    truth.check_end(video, frames)
    truth = truth.until(frames)
    if settings.regions:
        regions = Regions(settings.regions, info.width, info.height)
        true_labels = [
            label if regions.contains(label.track.foot) else label._replace(ignored=True)
            for label in truth.labels
        ]
        truth = replace(truth, labels=tuple(true_labels))
    comparison = compare(SavedTracks(tuple(labels)), truth)
    return ClipResult(str(video), comparison, frames, video)
