"""The plan of a batch: a run for each video. A wrong plan is refused before any work."""

import errno
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from vdet.batch.inputs import InputVideo, find_sources, matches_in
from vdet.batch.manifest import Written, check_manifest, read_written
from vdet.batch.task import Identity, result_digest
from vdet.errors import BatchError, OutputError
from vdet.files import check_output, is_input, record_input
from vdet.run.sinks.protocol import BatchTotal, Output, check_sinks, output_state, sink_kind
from vdet.run.video import Run

MANIFEST = "manifest.jsonl"


@dataclass(frozen=True, slots=True)
class OutputSuffix:
    """An output that every video of a batch gets.

    Attributes
    ----------
    sink
        The name of its sink.
    suffix
        The ending of its name, after that of the video. None: the video's own suffix if the sink
        can write it, else the first that the sink can write.
    """

    sink: str
    suffix: str | None = None


@dataclass(frozen=True, slots=True)
class PlannedTotal:
    """A file over all videos of a batch.

    `outputs` are those that it is made from, by the name of their video.
    """

    made_by: BatchTotal
    path: Path
    outputs: Mapping[str, Path]


@dataclass(frozen=True, slots=True)
class Plan:
    """The runs to do and those that are left out; all their outputs lie in `folder`."""

    folder: Path
    identity: Identity
    runs: tuple[Run, ...]
    skipped: tuple[Run, ...]
    totals: tuple[PlannedTotal, ...] = ()

    @property
    def manifest(self) -> Path:
        """The file for the records of the runs."""
        return self.folder / MANIFEST


def make_plan(
    clips: Sequence[Path],
    folder: Path,
    common: Run,
    suffixes: Sequence[OutputSuffix],
    *,
    skip_existing: bool = False,
) -> Plan:
    """Plan a run for every video of `clips`; outputs lie in `folder` by the places of the videos.

    The paths in the settings become absolute: processes on other machines work in other folders.

    Parameters
    ----------
    common
        A run with what all runs have in common.
    suffixes
        The outputs of each video; a sink may come several times.
    skip_existing
        Skip runs whose outputs are all there, and up to date as the manifest says. All outputs of
        the other runs are made again, but only those that vdet wrote are replaced.

    Raises
    ------
    BatchError
        There is no video; an input lies in `folder`, or `folder` in an input; two outputs have one
        name; with `skip_existing`, an output is there that vdet did not write.
    OutputError
        An output cannot be written, or is there already; the manifest cannot be used.
    ConfigError, ModelError
        There is no sink of a name, or the detector cannot be loaded.
    """
    settings = common.settings.with_paths(lambda path: str(Path(path).absolute()))
    common = replace(common, settings=settings)
    identity = Identity.of(common, {each.sink for each in suffixes})
    sources = find_sources(clips)
    _refuse_nested(clips, sources, folder)
    runs = [_planned(source, folder, common, suffixes) for source in sources]
    totals = _totals(sources, folder, suffixes)
    _refuse_shared(runs, totals, folder)
    manifest = folder / MANIFEST
    check_manifest(manifest)
    check_output(manifest, overwrite=True, makes_folder=True)
    replaces, skipped = common.overwrite, []
    if skip_existing:
        written, replaces = read_written(manifest), manifest.exists()
        done = [_is_done(run, identity, written) for run in runs]
        skipped = [run for run, is_done in zip(runs, done, strict=True) if is_done]
        left = [run for run, is_done in zip(runs, done, strict=True) if not is_done]
        runs = [_replacing_ours(run, written) for run in left]
    for run in runs:
        try:
            check_sinks(run.outputs, overwrite=run.overwrite, makes_folder=True)
        except OSError as error:
            if error.errno != errno.ENAMETOOLONG:  # such a file fails alone
                raise
    for total in totals:
        check_output(total.path, overwrite=replaces, makes_folder=True)
    return Plan(folder, identity, tuple(runs), tuple(skipped), totals)


def _totals(
    sources: Sequence[InputVideo], folder: Path, suffixes: Sequence[OutputSuffix]
) -> tuple[PlannedTotal, ...]:
    places = {source.place.with_suffix("").as_posix(): folder / source.place for source in sources}
    totals = []
    for each in suffixes:
        if total := sink_kind(each.sink).total:
            path = folder / f"{total.name}{total.suffix or each.suffix or ''}"
            outputs = {name: _path(place, each) for name, place in places.items()}
            totals.append(PlannedTotal(total, path, outputs))
    return tuple(totals)


def _planned(
    source: InputVideo, folder: Path, common: Run, suffixes: Sequence[OutputSuffix]
) -> Run:
    place = folder / source.place
    outputs = tuple(Output(each.sink, _path(place, each)) for each in suffixes)
    return replace(common, source=source.path, outputs=outputs)


def _path(place: Path, output: OutputSuffix) -> Path:
    if output.suffix is not None:
        return place.with_suffix(output.suffix)
    writable = sink_kind(output.sink).endings
    if not writable or place.suffix.lower() in writable:
        return place
    return place.with_suffix(writable[0])


def _is_done(run: Run, identity: Identity, written: Mapping[str, Written]) -> bool:
    """Return whether all outputs of a run are as they were written, for this batch and input."""
    digest = result_digest(identity, run.source)
    for output in run.outputs:
        state, known = output_state(output), written.get(os.path.realpath(output.path))
        if state is None or known is None or (known.digest, known.size) != (digest, state[0]):
            return False
    return True


def _replacing_ours(run: Run, written: Mapping[str, Written]) -> Run:
    """Return a run that replaces its outputs, where vdet wrote all of them that are there.

    Raises
    ------
    BatchError
        One is there that has another size or time than the manifest says, and is not empty.
    """
    for output in run.outputs:
        state, known = output_state(output), written.get(os.path.realpath(output.path))
        if state and state[0] and (known is None or (known.size, known.time) != state):
            raise BatchError(f"{output.path}: is not as vdet wrote it; remove it, or --overwrite")
    return replace(run, overwrite=any(os.path.lexists(output.path) for output in run.outputs))


def _refuse_nested(clips: Iterable[Path], sources: Iterable[InputVideo], folder: Path) -> None:
    resolved = folder.resolve()
    for clip in clips:
        if matches_in(clip, folder):
            raise BatchError(f"{folder}: lies in the input {clip}; give a folder outside")
    for source in sources:
        if source.path.resolve().is_relative_to(resolved):
            raise BatchError(f"{source.path}: lies in the output folder {folder}; give another")


def _refuse_shared(runs: Iterable[Run], totals: Iterable[PlannedTotal], folder: Path) -> None:
    """Refuse an output with the name of another output, of a total, the manifest or an input."""
    record_input(*(run.source for run in runs))
    owners = {folder / MANIFEST: "the manifest"}
    makers = [(total.path, "the outputs of all videos") for total in totals]
    makers += [(output.path, str(run.source)) for run in runs for output in run.outputs]
    for path, maker in makers:
        if is_input(path):
            raise OutputError(f"{path}: is an input itself; give another folder")
        if path in owners:
            raise BatchError(f"{owners[path]} and {maker}: both would become {path}; rename one")
        owners[path] = maker
