"""The plan of a batch: a job for each video. A wrong plan is refused before any work."""

import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from vdet.batch.digest import result_digest
from vdet.batch.inputs import Source, find_sources
from vdet.batch.manifest import Written, check_manifest, read_written
from vdet.errors import BatchError, OutputError
from vdet.files import check_output
from vdet.run.sinks.protocol import (
    BatchTotal,
    Output,
    check_sinks,
    output_size,
    sink_kind,
)
from vdet.run.video import VideoJob

MANIFEST = "manifest.jsonl"


@dataclass(frozen=True, slots=True)
class OutputSuffix:
    """An output that every video of a batch gets.

    Attributes
    ----------
    sink
        The name of its sink.
    suffix
        What its name ends in, after that of the video. None: the video's own suffix if the sink
        can write it, else the first that the sink can write.
    """

    sink: str
    suffix: str | None = None


@dataclass(frozen=True, slots=True)
class OutputOptions:
    """Which outputs every video gets, and what happens to outputs that are there already.

    Attributes
    ----------
    suffixes
        The outputs of each video; a sink may come several times.
    overwrite
        Outputs that are there already are replaced.
    skip_existing
        A job is left out if all its outputs are there, and the manifest says that they are up to
        date. Else all are made again.
    """

    suffixes: Sequence[OutputSuffix]
    overwrite: bool = False
    skip_existing: bool = False


@dataclass(frozen=True, slots=True)
class Total:
    """A file over all videos of a batch.

    `outputs` are those that it is made from, by the name of their video.
    """

    made_by: BatchTotal
    path: Path
    outputs: Mapping[str, Path]


@dataclass(frozen=True, slots=True)
class Plan:
    """The jobs to do and those that are left out; all their outputs lie in `folder`."""

    folder: Path
    jobs: tuple[VideoJob, ...]
    skipped: tuple[VideoJob, ...]
    totals: tuple[Total, ...] = ()

    @property
    def manifest(self) -> Path:
        """The file for the records of the jobs."""
        return self.folder / MANIFEST


def make_plan(
    clips: Sequence[Path],
    folder: Path,
    common: VideoJob,
    options: OutputOptions,
    digest: str = "",
) -> Plan:
    """Plan a job for every video of `clips`; outputs lie in `folder` by the places of the videos.

    Parameters
    ----------
    common
        A job with the times, the number of frames and the lanes of all jobs.
    digest
        From `work_digest`, for `skip_existing`.

    Raises
    ------
    BatchError
        There is no video; an input lies in `folder`, or `folder` in an input; two outputs have one
        name.
    OutputError
        An output cannot be written, or is there already; the manifest cannot be used.
    ConfigError
        There is no sink of a name.
    """
    _refuse_nested(clips, folder)
    sources = find_sources(clips)
    jobs = [_job(source, folder, common, options) for source in sources]
    _refuse_inside(sources, folder)
    totals = _totals(sources, folder, options)
    _refuse_equal(totals)
    _refuse_shared(jobs, folder, totals)
    manifest = folder / MANIFEST
    check_manifest(manifest)
    check_output(manifest, overwrite=True, makes_folder=True)
    written = read_written(manifest) if options.skip_existing else {}
    to_do: list[VideoJob] = []
    skipped: list[VideoJob] = []
    for job in jobs:
        (skipped if written and _is_done(job, digest, written) else to_do).append(job)
    for job in to_do:
        check_sinks(job.outputs, overwrite=job.overwrite, makes_folder=True)
    for total in totals:
        replaces = options.overwrite or options.skip_existing
        check_output(total.path, overwrite=replaces, makes_folder=True)
    return Plan(folder, tuple(to_do), tuple(skipped), totals)


def _totals(sources: Sequence[Source], folder: Path, options: OutputOptions) -> tuple[Total, ...]:
    return tuple(
        Total(
            total,
            folder / f"{total.name}{total.suffix or each.suffix or ''}",
            {
                source.place.with_suffix("").as_posix(): _path(folder / source.place, each)
                for source in sources
            },
        )
        for each in options.suffixes
        if (total := sink_kind(each.sink).total)
    )


def _job(source: Source, folder: Path, common: VideoJob, options: OutputOptions) -> VideoJob:
    place = folder / source.place
    outputs = [Output(each.sink, _path(place, each)) for each in options.suffixes]
    replaces = options.overwrite or (
        options.skip_existing and any(os.path.lexists(output.path) for output in outputs)
    )
    return replace(common, source=source.path, outputs=tuple(outputs), overwrite=replaces)


def _path(place: Path, output: OutputSuffix) -> Path:
    if output.suffix is not None:
        return place.with_suffix(output.suffix)
    writable = sink_kind(output.sink).suffixes
    if not writable or place.suffix.lower() in writable:
        return place
    return place.with_suffix(writable[0])


def _is_done(job: VideoJob, digest: str, written: Mapping[str, Written]) -> bool:
    """Return whether all outputs of a job are as they were written, for this work and input."""
    digest = result_digest(digest, job.source)
    return all(
        (size := output_size(output)) is not None
        and written.get(os.path.realpath(output.path)) == Written(digest, size)
        for output in job.outputs
    )


def _refuse_nested(clips: Iterable[Path], folder: Path) -> None:
    for clip in clips:
        if clip.is_dir() and folder.resolve().is_relative_to(clip.resolve()):
            raise BatchError(
                f"{folder}: lies in the input folder {clip}, and its videos would be inputs of the "
                "next run; give a folder outside"
            )


def _refuse_inside(sources: Iterable[Source], folder: Path) -> None:
    resolved = folder.resolve()
    for source in sources:
        if source.path.resolve().is_relative_to(resolved):
            raise BatchError(
                f"{source.path}: this input lies in the output folder {folder}; give another"
            )


def _refuse_equal(totals: Sequence[Total]) -> None:
    for path, count in Counter(total.path for total in totals).items():
        if count > 1:
            raise BatchError(f"{path}: two outputs over all videos would have this name; keep one")


def _refuse_shared(jobs: Iterable[VideoJob], folder: Path, totals: Sequence[Total]) -> None:
    """Refuse an output with the name of another output, of a total, the manifest or an input."""
    inputs = {job.source.resolve() for job in jobs}
    owners: dict[Path, Path] = {}
    total_paths = {total.path for total in totals}
    for job in jobs:
        for path in (output.path for output in job.outputs):
            if path.resolve() in inputs:
                raise OutputError(f"{path}: is an input itself; give another folder")
            if path == folder / MANIFEST:
                raise BatchError(
                    f"{job.source}: one of its outputs would be {path}, which is the manifest"
                )
            if path in total_paths:
                raise BatchError(
                    f"{job.source}: one of its outputs would be {path}, which is over all videos; "
                    "rename the video"
                )
            if path not in owners:
                owners[path] = job.source
            elif (other := owners[path]) == job.source:
                raise BatchError(f"{path}: two outputs of {job.source} would have this name")
            else:
                raise BatchError(
                    f"{other} and {job.source}: both would become {path}; rename one, or take "
                    "them from a folder above both"
                )
