"""What a batch will do: a job a video, refused as a whole before any work if it cannot be right."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from vdet.batch.inputs import Source, find_sources
from vdet.errors import BatchError, OutputError
from vdet.files import check_output
from vdet.media.writer import VIDEO_SUFFIXES
from vdet.pipeline.run import VideoJob

MANIFEST = "manifest.jsonl"


@dataclass(frozen=True, slots=True)
class Wishes:
    """What is to be made of every video, and what of outputs that are there already.

    `tracks` is the suffix of the files of tracks; None for none. With `skip_existing` a job is left
    out if all its outputs are there, and makes all of them anew if only some are.
    """

    video: bool = True
    tracks: str | None = None
    overwrite: bool = False
    skip_existing: bool = False


@dataclass(frozen=True, slots=True)
class Plan:
    """The jobs to do, and those that were done before, with `folder` for all of their outputs."""

    folder: Path
    jobs: tuple[VideoJob, ...]
    skipped: tuple[VideoJob, ...]

    @property
    def manifest(self) -> Path:
        """Where the records of the jobs go."""
        return self.folder / MANIFEST


def make_plan(clips: Sequence[Path], folder: Path, common: VideoJob, wishes: Wishes) -> Plan:
    """Plan a job for every video that `clips` stand for; outputs lie in `folder` as these do.

    Parameters
    ----------
    common
        What all jobs have in common: times, number of frames, lanes.

    Raises
    ------
    BatchError
        There is no video; `folder` and an input lie in one another; two outputs have one name.
    OutputError
        An output cannot be written, or is there already.
    """
    _refuse_nested(clips, folder)
    sources = find_sources(clips)
    jobs = [_job(source, folder, common, wishes) for source in sources]
    _refuse_inside(sources, folder)
    _refuse_shared(jobs, folder)
    done = [wishes.skip_existing and _is_done(job) for job in jobs]
    plan = Plan(folder, tuple(_where(jobs, done, False)), tuple(_where(jobs, done, True)))
    check_output(plan.manifest, overwrite=True, makes_folder=True)
    for path in (path for job in plan.jobs for path in job.outputs):
        replaces = wishes.overwrite or wishes.skip_existing
        check_output(path, overwrite=replaces, makes_folder=True)
    return plan


def _job(source: Source, folder: Path, common: VideoJob, wishes: Wishes) -> VideoJob:
    place = folder / source.place
    video = place if place.suffix.lower() in VIDEO_SUFFIXES else place.with_suffix(".mp4")
    return replace(
        common,
        source=source.path,
        video=video if wishes.video else None,
        tracks=place.with_suffix(wishes.tracks) if wishes.tracks else None,
    )


def _where(jobs: Sequence[VideoJob], done: Sequence[bool], wanted: bool) -> Iterator[VideoJob]:
    return (job for job, is_done in zip(jobs, done, strict=True) if is_done is wanted)


def _is_done(job: VideoJob) -> bool:
    return all(path.is_file() for path in job.outputs)


def _refuse_nested(clips: Iterable[Path], folder: Path) -> None:
    for clip in clips:
        if clip.is_dir() and folder.resolve().is_relative_to(clip.resolve()):
            raise BatchError(
                f"{folder}: lies in the input folder {clip}, and its videos would be inputs of the "
                "next run; give a folder outside"
            )


def _refuse_inside(sources: Iterable[Source], folder: Path) -> None:
    inside = folder.resolve()
    for source in sources:
        if source.path.resolve().is_relative_to(inside):
            raise BatchError(
                f"{source.path}: this input lies in the output folder {folder}; give another"
            )


def _refuse_shared(jobs: Iterable[VideoJob], folder: Path) -> None:
    """Refuse an output that is another job's too, or the manifest, or an input."""
    inputs = {job.source.resolve() for job in jobs}
    owners: dict[Path, Path] = {}
    for job in jobs:
        for output in job.outputs:
            if output.resolve() in inputs:
                raise OutputError(f"{output}: is an input itself; give another folder")
            if output == folder / MANIFEST:
                raise BatchError(
                    f"{job.source}: its tracks would be {output}, which is the manifest"
                )
            other = owners.setdefault(output, job.source)
            if other != job.source:
                raise BatchError(
                    f"{other} and {job.source}: both would become {output}; rename one, or take "
                    "them from a folder above both"
                )
