"""Plan and run a batch: find its videos, process each, and write its record when it is done."""

import logging
import os
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from vdet.batch.task import (
    MANIFEST,
    ManifestRecord,
    allow_replacing,
    is_up_to_date,
    new_record,
    open_manifest,
    outputs_by_path,
    process_file,
    read_batch,
)
from vdet.detect.detectors import load_detector
from vdet.errors import BatchError, OutputError, VideoError
from vdet.files import FileIds, OutputFiles, make_folder, output_errors, remove_stale
from vdet.media.demux import reject_address
from vdet.media.images import IMAGE_SUFFIXES, numbered_images
from vdet.run.inputs import input_files
from vdet.run.sinks import Output
from vdet.run.sinks.folders import is_clip
from vdet.run.sinks.protocol import BatchTotal, check_sinks, sink_kind
from vdet.run.video import Run
from vdet.workers import Workers, call_all

_log = logging.getLogger("vdet")

VIDEO_INPUT_SUFFIXES = frozenset((
    ".264", ".265", ".3g2", ".3gp", ".asf", ".avi", ".dav", ".dv", ".f4v", ".flv", ".h264", ".h265",
    ".hevc", ".insv", ".m2t", ".m2ts", ".m2v", ".m4v", ".mjpeg", ".mjpg", ".mkv", ".mov", ".mp4",
    ".mpeg", ".mpg", ".mts", ".mxf", ".ogv", ".ts", ".vob", ".webm", ".wmv", ".y4m",
))  # fmt: skip
"""Suffixes of videos in a folder. A file passed by name may have any suffix."""

DRAWN = ".vdet"
"""Part before the suffix in the name of a video written beside its source."""


@dataclass(frozen=True, slots=True)
class InputVideo:
    """A video, and its path relative to the input folder."""

    path: Path
    relative_path: Path


def find_sources(clips: Sequence[Path]) -> list[InputVideo]:
    """Return the videos of `clips`, each once.

    Each clip is one of these, and the videos of a folder are in the order of their names:

    * a file, or numbered images such as ``img_%04d.png``;
    * a folder: the videos in it, recursively, without hidden files and folders. A folder that has
      numbered images and no videos is a video itself.

    Videos that vdet wrote beside their sources, and clips that it cut, are skipped, unless they are
    passed by name.
    Folders of several kinds of images are skipped with a warning (logger "vdet").

    Raises
    ------
    BatchError
        One of `clips` has no video, or a folder cannot be read.
    VideoError
        One of `clips` is an address, or numbered images with a gap.
    """
    videos: dict[tuple[Path, Path], InputVideo] = {}
    for clip in clips:
        videos_of_clip = sorted(_videos_of(clip), key=lambda video: video.relative_path)
        if not videos_of_clip:
            raise BatchError(f"{clip}: no video found; check the name, without quoted patterns")
        for video in videos_of_clip:
            videos.setdefault((video.path.resolve(), video.relative_path), video)
    return list(videos.values())


def _videos_of(clip: Path) -> Iterable[InputVideo]:
    if clip.is_dir():
        return _below(clip, clip)
    if clip.exists():
        return [InputVideo(clip, Path(clip.name))]
    reject_address(clip)
    if numbered_images(clip):
        return [InputVideo(clip, Path(f"{clip.absolute().parent.name}{clip.suffix}"))]
    return []


def _below(folder: Path, base: Path) -> Iterator[InputVideo]:
    for root, folders, names in os.walk(folder, onerror=_reject_unreadable):
        folders[:] = [name for name in folders if not name.startswith(".")]
        videos = [path for name in names if _is_video(path := Path(root, name))]
        for path in videos:
            yield InputVideo(path, path.relative_to(base))
        suffixes = {Path(name).suffix.lower() for name in names if not name.startswith(".")}
        if not videos and suffixes & IMAGE_SUFFIXES:
            yield from _images_in(Path(root), base)


def _images_in(folder: Path, base: Path) -> Iterator[InputVideo]:
    """Yield the numbered images of a folder as one video, with the name of the folder."""
    try:
        images = numbered_images(folder)
    except VideoError as error:
        _log.warning("%s; skipped", error)
        return
    named = Path(folder.absolute().name) if folder == base else folder.relative_to(base)
    yield InputVideo(folder, named.with_name(f"{named.name}{images[0].suffix}"))


def _is_video(path: Path) -> bool:
    is_skipped = path.name.startswith(".") or path.stem.endswith(DRAWN) or is_clip(path)
    return path.suffix.lower() in VIDEO_INPUT_SUFFIXES and not is_skipped


def _reject_unreadable(error: OSError) -> None:
    raise BatchError(f"{error.filename}: cannot be read: {error.strerror}; remove it") from error


_KILLED = "{}: its process was killed or crashed; it may have run out of memory"


@dataclass(frozen=True, slots=True)
class TotalFile:
    """A file over all videos.

    `kind` writes it to `path`, from the outputs at position `output_number` in every run, whose
    names have this `ending` after that of the video.
    """

    path: Path
    kind: BatchTotal
    output_number: int
    ending: str


@dataclass(frozen=True, slots=True)
class Plan:
    """The runs to process and those to skip; all their outputs are in `folder`.

    `doubtful` of those to skip may have wrong results, by their records.
    """

    folder: Path
    runs: tuple[Run, ...]
    skipped: tuple[Run, ...]
    totals: tuple[TotalFile, ...]
    doubtful: int = 0


def make_plan(
    clips: Sequence[Path], folder: Path, common: Run, *, skip_existing: bool = False
) -> Plan:
    """Plan a run for every video of `clips`.

    The outputs are in `folder`, where the videos are in their input folders. The paths in the
    settings become absolute, because other machines have other working folders.

    Parameters
    ----------
    common
        A run with everything that all runs have in common. The paths of its outputs are the endings
        of their names, after the name of the video, such as `.csv`. An empty one stands for the
        first suffix of the sink.
    skip_existing
        Skip runs whose outputs all exist and are up to date by the manifest. All outputs of the
        other runs are made again; only outputs that vdet wrote are replaced.

    Raises
    ------
    BatchError
        There is no video; an input is inside `folder`, or `folder` inside an input; two outputs
        have the same name; with `skip_existing`, an output exists that vdet did not write.
    OutputError
        An output cannot be written, or already exists; the manifest cannot be used.
    ConfigError, ModelError
        A sink is unknown, or the detector cannot be loaded.
    """
    settings = common.settings.with_paths(lambda path: str(Path(path).absolute()))
    load_detector(settings.detector)
    sources = find_sources(clips)
    _reject_nested(clips, sources, folder)
    settings_files = tuple(path.absolute() for path in common.settings_files)
    totals = tuple(
        TotalFile(folder / f"{kind.name}{kind.suffix or ending}", kind, number, ending)
        for number, output in enumerate(common.outputs)
        for ending in [output.path.name]
        if (kind := sink_kind(output.sink).total)
    )
    linked = tuple(Output(common.outputs[total.output_number].sink, total.path) for total in totals)
    common = replace(common, settings=settings, settings_files=settings_files, totals=linked)
    runs = [_run_of(source, folder, common) for source in sources]
    _reject_shared(runs, totals, folder)
    videos = (source.path for source in sources)
    inputs = input_files(*videos, *settings_files, settings=settings)
    manifest, skipped, doubtful = folder / MANIFEST, list[Run](), 0
    OutputFiles(overwrite=True, inputs=inputs).check(manifest, makes_folder=True)
    if skip_existing:
        records = list(read_batch(folder))
        written = outputs_by_path(records)
        latest = {
            os.path.realpath(item.path): record for record in records for item in record.outputs
        }
        all_runs, runs = runs, []
        for run in all_runs:
            if is_up_to_date(run, written):
                skipped.append(run)
                doubtful += latest[os.path.realpath(run.outputs[0].path)].is_doubtful
            else:
                runs.append(allow_replacing(run, written))
    for run in runs:
        _check_outputs(run, inputs)
    replaces_totals = common.overwrite or (skip_existing and manifest.exists())
    total_files = OutputFiles(overwrite=replaces_totals, inputs=inputs)
    for total in totals:
        total_files.check(total.path, makes_folder=True)
    return Plan(folder, tuple(runs), tuple(skipped), totals, doubtful)


def _run_of(source: InputVideo, folder: Path, common: Run) -> Run:
    """Return the run of a video, with its outputs in `folder`."""
    video = folder / source.relative_path
    endings = (item.path.name or sink_kind(item.sink).endings[0] for item in common.outputs)
    named = zip(common.outputs, map(video.with_suffix, endings), strict=True)
    outputs = tuple(replace(output, path=path) for output, path in named)
    return replace(common, source=source.path, outputs=outputs)


def _check_outputs(run: Run, inputs: FileIds) -> None:
    """Raise `OutputError` if an output of a run cannot be written."""
    try:
        files = OutputFiles(overwrite=run.overwrite, inputs=inputs)
        check_sinks(run.outputs, files, makes_folder=True)
    except OutputError as error:
        error.field = error.field and "skip_existing"
        raise


def _reject_nested(clips: Iterable[Path], sources: Iterable[InputVideo], folder: Path) -> None:
    inner = folder.resolve()
    for clip in clips:
        if clip.is_dir() and inner.is_relative_to(clip.resolve()):
            raise BatchError(f"{folder}: is inside the input {clip}; use another folder")
    for source in sources:
        if source.path.resolve().is_relative_to(inner):
            raise BatchError(f"{source.path}: is inside the output folder {folder}; use another")


def _reject_shared(runs: Iterable[Run], totals: Iterable[TotalFile], folder: Path) -> None:
    """Reject an output with the name of another output, a total or the manifest."""
    owners = {folder / MANIFEST: "the manifest"}
    makers = [(total.path, f"the table of all {total.ending}") for total in totals]
    makers += [(output.path, str(run.source)) for run in runs for output in run.outputs]
    for path, maker in makers:
        if path in owners:
            raise BatchError(
                f"{owners[path]} and {maker}: both would be written to {path}; rename one"
            )
        owners[path] = maker


def run_batch(
    plan: Plan, *, workers: Workers, threads: int | None = None
) -> Generator[tuple[Run, ManifestRecord]]:
    """Process the files of a plan; yield each when it is done and its record is in the manifest.

    `threads` is the number of threads for each run that does not set it. At the end, the files over
    all videos are written, and temporary files of killed workers are removed.

    Raises
    ------
    OutputError
        The manifest, or the output folder, cannot be written.
    ClusterError
        The cluster of `workers` cannot be used, or its scheduler has ended.
    """
    make_folder(plan.folder)
    runs = [replace(run, threads=run.threads or threads) for run in plan.runs]
    function, errors = partial(process_file, folder=plan.folder), {}
    try:
        with (
            open_manifest(plan.folder) as add,
            closing(call_all(function, runs, workers)) as results,
        ):
            for run, result in results:
                record = result or replace(new_record(run), error=_KILLED.format(run.source))
                add(record)
                errors[run.outputs[0].path] = record.error
                yield run, record
            _write_totals(plan, errors)
    finally:
        paths = (output.path for run in runs for output in run.outputs)
        for folder in {item for path in paths for item in (path, *path.parents)}:
            if folder.is_relative_to(plan.folder):
                remove_stale(folder)


def _write_totals(plan: Plan, errors: Mapping[Path, str | None]) -> None:
    """Write the files over all videos, from the records of existing outputs.

    `errors` are those of this batch, by the first output of each run.
    """
    if not plan.totals:
        return
    written = outputs_by_path(read_batch(plan.folder))
    runs = sorted((*plan.runs, *plan.skipped), key=lambda run: run.outputs[0].path)
    for total in plan.totals:
        summaries = {}
        for run in runs:
            path, error = run.outputs[total.output_number].path, errors.get(run.outputs[0].path)
            name = path.relative_to(plan.folder).as_posix().removesuffix(total.ending)
            versions = written.get(os.path.realpath(path))
            if error and total.kind.of_failed:
                summaries[name] = total.kind.of_failed(error)
            elif versions and os.path.exists(path):  # noqa: PTH110  # too long a name
                summaries[name] = versions[-1].summary
        with OutputFiles(overwrite=True) as files, output_errors(total.path):
            total.kind.write(summaries, files.stage(total.path))
