"""Batches of videos: find them, plan a run for each, process it, and keep its record.

The manifest has a line of JSON for every file, added as soon as the file is done. The worker writes
the record of a file as a note into a hidden folder of the batch, just before the outputs are
renamed. The note moves into the manifest when the file is done; if the batch is interrupted, when
it ends, and if it is killed, when the next one ends. So a batch never has outputs without their
record.
"""

import errno
import hashlib
import json
import logging
import os
import pickle
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, BinaryIO

from vdet.detect.detectors import DetectorModel, load_detector, model_file
from vdet.errors import BatchError, OutputError, VideoError, in_one_line
from vdet.files import (
    FileIds,
    OutputFiles,
    json_line,
    lock,
    make_folder,
    output_errors,
    remove_stale,
    write_whole,
)
from vdet.media.images import IMAGE_SUFFIXES, numbered_images
from vdet.media.reader import reject_address
from vdet.plugins import plugin_packages
from vdet.run.images import input_files
from vdet.run.loop import Parts
from vdet.run.sinks import Output
from vdet.run.sinks.folders import is_clip
from vdet.run.sinks.protocol import check_sinks, output_state, sink_kind
from vdet.run.steps import FINDINGS
from vdet.run.video import Run, write_outputs
from vdet.version import __version__
from vdet.workers import Workers, call_all, limit_library_threads

MANIFEST = "manifest.jsonl"
_NOTES = ".vdet-notes"

VIDEO_INPUT_SUFFIXES = frozenset((
    ".264", ".265", ".3g2", ".3gp", ".asf", ".avi", ".dav", ".dv", ".f4v", ".flv", ".h264", ".h265",
    ".hevc", ".insv", ".m2t", ".m2ts", ".m2v", ".m4v", ".mjpeg", ".mjpg", ".mkv", ".mov", ".mp4",
    ".mpeg", ".mpg", ".mts", ".mxf", ".ogv", ".ts", ".vob", ".webm", ".wmv", ".y4m",
))  # fmt: skip
"""Suffixes of videos in a folder. A file passed by name may have any suffix."""

DRAWN = ".vdet"
"""Part before the suffix in the name of a video written beside its source."""
_log = logging.getLogger("vdet")
_KILLED = "{}: its process was killed or crashed; it may have run out of memory"


@dataclass(frozen=True, slots=True)
class Written:
    """A written output.

    Attributes
    ----------
    sink, path
        The name of its sink; its absolute path.
    bytes, changed
        Its size and modification time (nanoseconds since 1970); for a folder, the sum and the
        latest of its files.
    digest
        SHA-256 of everything that it depends on: see `vdet.batch`.
    summary
        What a file over all videos needs from it: see `BatchTotal`.
    """

    sink: str
    path: str
    bytes: int
    changed: int
    digest: str
    summary: Any = None


@dataclass(frozen=True, slots=True)
class ManifestRecord:
    """The result of one file.

    Attributes
    ----------
    input
        Its absolute path.
    started
        Start time in UTC, ISO 8601.
    seconds
        Wall time.
    model, model_sha256
        Name and SHA-256 of the model file; None for a detector without one.
    width, height
        Size of the upright frames, pixels.
    frames, tracks
        Number of frames read, and of tracks shown.
    begin
        When the recording began, and the source of that time; None if unknown.
    facts
        Results of steps about the whole video, by name.
    outputs
        Empty after an error.
    error
        None on success; otherwise there are no outputs, and no numbers except the seconds.
    program
        Name and version of the program.
    """

    input: str
    started: str
    seconds: float = 0.0
    model: str | None = None
    model_sha256: str | None = None
    width: int | None = None
    height: int | None = None
    frames: int | None = None
    tracks: int | None = None
    begin: str | None = None
    facts: Mapping[str, Any] = field(default_factory=dict)
    outputs: tuple[Written, ...] = ()
    warnings: tuple[str, ...] = ()
    error: str | None = None
    program: str = f"vdet {__version__}"

    @property
    def is_doubtful(self) -> bool:
        """Whether a result may be wrong."""
        findings = self.facts.get(FINDINGS, ())
        return any(finding["severity"] == "warning" for finding in findings)

    @property
    def line(self) -> str:
        """The line of the manifest."""
        return json_line(asdict(self))


def note_path(folder: Path, path: Path) -> Path:
    """Return the path of the note about the run with this first output."""
    name = hashlib.sha256(os.fsencode(path.absolute())).hexdigest()
    return folder / _NOTES / f"{name[:32]}.json"


def read_records(*paths: Path) -> Iterator[ManifestRecord]:
    """Yield the records in some files; missing files and invalid records are skipped.

    Raises
    ------
    OutputError
        A file cannot be read.
    """
    for path in paths:
        with output_errors(path), suppress(FileNotFoundError), path.open("rb") as file:
            for line in file:
                with suppress(ValueError, TypeError, KeyError, RecursionError):
                    values = json.loads(line)
                    outputs = tuple(Written(**output) for output in values["outputs"])
                    yield ManifestRecord(**{**values, "outputs": outputs})


def read_batch(folder: Path) -> Iterator[ManifestRecord]:
    """Yield the records of all batches in a folder, in order. Errors as for `read_records`."""
    return read_records(folder / MANIFEST, *_notes(folder))


def _notes(folder: Path) -> list[Path]:
    return sorted((folder / _NOTES).glob("*.json"))


@contextmanager
def open_manifest(folder: Path) -> Iterator[Callable[[ManifestRecord], None]]:
    """Yield a function that appends a record to the manifest and syncs it to disk.

    The manifest is locked: no other batch can write into the folder until the block ends. At the
    end, notes of an interrupted or earlier batch are moved into it.

    Raises
    ------
    OutputError
        The file cannot be written (from the function, too), or another batch has locked it.
    """
    path = folder / MANIFEST
    with output_errors(path):
        file = path.open("a+b", buffering=0)
    with file:
        try:
            lock(file.fileno())
        except BlockingIOError:
            message = f"{path}: another batch is writing here; wait, or use another folder"
            raise OutputError(message) from None

        def append(line: str) -> None:
            with output_errors(path):
                if file.write(line.encode()) < len(line):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                os.fsync(file.fileno())

        def add(record: ManifestRecord) -> None:
            append(record.line)
            if record.outputs:
                note_path(folder, Path(record.outputs[0].path)).unlink(missing_ok=True)

        if not _ends_with_whole_line(file):
            append("\n")  # a power cut or a full disk left half a line
        try:
            yield add
        finally:
            for record in read_records(*_notes(folder)):
                add(record)
            remove_stale(folder / _NOTES)
            with suppress(OSError):  # a worker of an earlier batch may still write into it
                (folder / _NOTES).rmdir()


def _ends_with_whole_line(file: BinaryIO) -> bool:
    size = file.seek(0, os.SEEK_END)
    file.seek(max(0, size - 1))
    return file.read(1) in (b"", b"\n")


WrittenByPath = Mapping[str, Sequence[Written]]
"""Written outputs by their real paths; the latest is last."""


def result_digest(run: Run) -> str:
    """Return a digest of everything that the outputs of a run depend on.

    This is the program, packages with plug-ins, the model, the settings, the part, the time zone of
    this computer, and the name, size and time of the input, of all numbered images, of the masks
    and of the picture.
    """
    settings = run.settings
    shown = (*(region.mask for region in settings.regions), settings.survey.picture)
    images = (Path(name) for name in shown if name)
    files = filter(Path.exists, (*(numbered_images(run.source) or [run.source]), *images))
    parts = (
        *(f"vdet {__version__}", run.start, run.end, run.frames, time.timezone, time.tzname),
        *plugin_packages(),
        _sha256(model_file(settings.detector)),
        *((file.name, file.stat().st_size, file.stat().st_mtime_ns) for file in files),
        settings.with_paths(lambda _: "").model_dump_json(
            exclude={"train": True, "labels": True, "detector": {"model"}}
        ),
    )
    return hashlib.sha256("\0".join(map(repr, parts)).encode()).hexdigest()


def _sha256(path: Path | None) -> str | None:
    """Return the SHA-256 of a file; None if it does not exist."""
    with suppress(OSError):
        if path:
            state = path.stat()
            return _cached_sha256(path, state.st_ino, state.st_mtime_ns, state.st_size)
    return None


@lru_cache(maxsize=16)
def _cached_sha256(path: Path, *_state: int) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def outputs_by_path(records: Iterable[ManifestRecord]) -> WrittenByPath:
    """Return the outputs in some records."""
    outputs: dict[str, list[Written]] = {}
    for record in records:
        for output in record.outputs:
            outputs.setdefault(os.path.realpath(output.path), []).append(output)
    return outputs


def is_up_to_date(run: Run, written: WrittenByPath) -> bool:
    """Return whether the outputs of a run have their recorded sizes and the current digest."""
    digest = result_digest(run)
    for output in run.outputs:
        size, _ = output_state(output) or (None, None)
        latest = written.get(os.path.realpath(output.path), [None])[-1]
        if size is None or latest is None or (latest.digest, latest.bytes) != (digest, size):
            return False
    return True


def allow_replacing(run: Run, written: WrittenByPath) -> Run:
    """Return a run that may replace its outputs, if vdet wrote all that exist.

    Raises
    ------
    BatchError
        A non-empty output has a size or time that is not in any record.
    """
    for output in run.outputs:
        state, versions = output_state(output), written.get(os.path.realpath(output.path), ())
        if state and state[0] and state not in {(item.bytes, item.changed) for item in versions}:
            raise BatchError(f"{output.path}: has changed since vdet wrote it", field="overwrite")
    return replace(run, overwrite=any(os.path.lexists(output.path) for output in run.outputs))


def process_file(run: Run, *, folder: Path) -> ManifestRecord:
    """Process a video, and return its record, which is also written as a note into the folder.

    Errors are recorded, not raised. After its process was killed, it can be called again: the
    outputs are made again unless they were complete.
    """
    limit_library_threads()
    began, record = time.perf_counter(), new_record(run)
    note = note_path(folder, run.outputs[0].path)
    with _collected_warnings() as warnings:
        try:
            for earlier in read_records(note):
                written = outputs_by_path([earlier])
                if is_up_to_date(run, written):
                    return earlier
                run = run if run.overwrite else allow_replacing(run, written)
            with OutputFiles(overwrite=run.overwrite, inputs=run.inputs) as files:
                record = replace(_written(run, record, files), warnings=tuple(warnings))
                write_whole(note, record.line, overwrite=True)
        except Exception as failure:
            note.unlink(missing_ok=True)
            seconds, error = round(time.perf_counter() - began, 3), in_one_line(failure)
            return replace(new_record(run), seconds=seconds, error=error, warnings=tuple(warnings))
    return record


def _written(run: Run, record: ManifestRecord, files: OutputFiles) -> ManifestRecord:
    """Write the outputs, still under temporary names, and return their record."""
    digest = result_digest(run)
    detector = pickle.dumps(run.settings.detector)  # settings of other packages may be unhashable
    totals = write_outputs(run, files, Parts(_cached_detector(detector, record.model_sha256)))
    written = []
    for output in run.outputs:
        size, changed = output_state(output, files.staged_path(output.path)) or (0, 0)
        path = str(output.path.absolute())
        summary = totals.summaries[output.path] if sink_kind(output.sink).total else None
        written.append(Written(output.sink, path, size, changed, digest, summary))
    return replace(
        record,
        seconds=round(totals.seconds, 3),
        width=totals.width,
        height=totals.height,
        frames=totals.frames,
        tracks=totals.tracks,
        begin=str(totals.clock) if totals.clock else None,
        facts={name: fact.record() for name, fact in totals.facts.items()},
        outputs=tuple(written),
    )


@lru_cache(maxsize=1)
def _cached_detector(settings: bytes, _model_sha256: str | None) -> DetectorModel:
    """Load a detector, and keep it for the next videos of this process."""
    return load_detector(pickle.loads(settings))


def new_record(run: Run) -> ManifestRecord:
    """Return the record of a run that starts now."""
    model = model_file(run.settings.detector)
    return ManifestRecord(
        input=str(run.source.absolute()),
        started=datetime.now(UTC).isoformat(timespec="seconds"),
        model=model.name if model else None,
        model_sha256=_sha256(model),
    )


@contextmanager
def _collected_warnings() -> Iterator[list[str]]:
    """Yield a list of the warnings in the block; the receiver of the record prints them."""
    messages: list[str] = []

    def collect(record: logging.LogRecord) -> bool:
        if record.levelno == logging.WARNING:
            messages.append(record.getMessage())
        return record.levelno != logging.WARNING

    log = logging.getLogger("vdet")
    log.addFilter(collect)
    try:
        yield messages
    finally:
        log.removeFilter(collect)


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


@dataclass(frozen=True, slots=True)
class Plan:
    """The runs to process and those to skip; all their outputs are in `folder`.

    `common` has the settings of all runs; the paths of its outputs are endings, and their `total`
    are the files over all videos. `doubtful` is the number of skipped runs that may have wrong
    results, by their records.
    """

    folder: Path
    common: Run
    runs: tuple[Run, ...]
    skipped: tuple[Run, ...]
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
    outputs = tuple(_with_total(output, folder) for output in common.outputs)
    common = replace(common, settings=settings, settings_files=settings_files, outputs=outputs)
    runs = [_run_of(source, folder, common) for source in sources]
    _reject_shared(runs, outputs, folder)
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
    for output in outputs:
        if output.total:
            total_files.check(output.total, makes_folder=True)
    return Plan(folder, common, tuple(runs), tuple(skipped), doubtful)


def _with_total(output: Output, folder: Path) -> Output:
    """Return an output, whose path is an ending, with the file over all videos, if it has one."""
    total = sink_kind(output.sink).total
    name = total and f"{total.name}{total.suffix or output.path.name}"
    return replace(output, total=folder / name if name else None)


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


def _reject_shared(runs: Iterable[Run], endings: Iterable[Output], folder: Path) -> None:
    """Reject an output with the name of another output, a total or the manifest."""
    owners = {folder / MANIFEST: "the manifest"}
    makers = [(item.total, f"the table of all {item.path}") for item in endings if item.total]
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
    BatchError
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
    if not any(output.total for output in plan.common.outputs):
        return
    written = outputs_by_path(read_batch(plan.folder))
    runs = sorted((*plan.runs, *plan.skipped), key=lambda run: run.outputs[0].path)
    for number, output in enumerate(plan.common.outputs):
        kind, summaries = sink_kind(output.sink).total, {}
        if not (kind and output.total):
            continue
        for run in runs:
            path, error = run.outputs[number].path, errors.get(run.outputs[0].path)
            name = path.relative_to(plan.folder).as_posix().removesuffix(output.path.name)
            versions = written.get(os.path.realpath(path))
            if error and kind.of_failed:
                summaries[name] = kind.of_failed(error)
            elif versions and os.path.exists(path):  # noqa: PTH110  # too long a name
                summaries[name] = versions[-1].summary
        with OutputFiles(overwrite=True) as files, output_errors(output.total):
            kind.write(summaries, files.stage(output.total))
