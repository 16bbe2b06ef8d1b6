"""The protocol of an output (a sink), its kinds, and how outputs are checked and opened."""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, Literal, Protocol, Self

from vdet.conditions.finding import Finding
from vdet.conditions.watch import Conditions
from vdet.config.schema import Settings
from vdet.detect.protocol import StagePictures
from vdet.errors import OutputError
from vdet.files import MayReplace, OutputFiles, any_file, check_output, output_errors
from vdet.media import VideoInfo
from vdet.plugins import SINKS, load_plugin
from vdet.run.result import FrameResult
from vdet.traffic.clock import Clock
from vdet.traffic.live import LiveTraffic

STANDARD_OUTPUT = Path("-")


class Sink(AbstractContextManager["Sink"], Protocol):
    """Takes the results of a run, frame by frame; a context manager.

    It writes into files that it gets from `SinkContext.files`. They appear under their names when
    the whole run ends without an error, and not at all otherwise. When the `with` block of the sink
    ends without an error, its files must be complete.
    """

    def write(self, result: FrameResult) -> None:
        """Take the next result. It must not change the frame's image."""


@dataclass(frozen=True, slots=True)
class Output:
    """An output of a run: the name of its sink, and its path."""

    sink: str
    path: Path


@dataclass(frozen=True, slots=True)
class SinkContext:
    """What a sink gets when it is opened.

    Attributes
    ----------
    files
        Gives temporary files: `files.stage(path)`.
    video
        The video that is read; None if the results are of still pictures.
    is_part
        Whether only a part of the video is read.
    at
        The option `--at`: seconds from the first frame.
    threads
        Number of threads of an encoder; None lets it choose.
    clock
        When the video begins; None where it is not known.
    timeout
        Seconds after which a write that does not end is an error.
    outputs
        All outputs of the run, for a sink that refers to another.
    traffic
        The counts and the speeds of a video, up to the latest result; None for still pictures.
    conditions
        What makes the results of a video doubtful, up to the latest one; None for still pictures.
    stage_pictures
        Returns a picture of each stage of the detection by its name, in order. It takes the image
        of a frame and its detections.
    """

    files: OutputFiles
    settings: Settings
    video: VideoInfo | None = None
    is_part: bool = False
    at: Fraction = Fraction(0)
    threads: int | None = None
    clock: Clock | None = None
    timeout: float | None = None
    outputs: tuple[Output, ...] = ()
    traffic: LiveTraffic | None = None
    conditions: Conditions | None = None
    stage_pictures: StagePictures = lambda *_: {}

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What makes the results doubtful so far."""
        return self.conditions.findings() if self.conditions else ()

    @property
    def is_still(self) -> bool:
        """Whether the camera stood still so far."""
        return self.conditions is not None and self.conditions.is_still


class BaseSink:
    """What most sinks have in common: they finish where the run ends without an error.

    `summary` is what a batch keeps of the output in its manifest, as values for JSON.
    """

    summary: Mapping[str, Any] | None = None

    def __init__(self, path: Path, context: SinkContext) -> None:
        self.path = path
        self.context = context

    @property
    def video(self) -> VideoInfo:
        """The video, for sinks that take no pictures."""
        assert self.context.video is not None  # `SinkKind.takes` says so
        return self.context.video

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: Any, *_: object) -> None:
        if kind is None:
            self.finish()

    def finish(self) -> None:
        """Write what is still to be written."""


@dataclass(frozen=True, slots=True)
class VideoPart:
    """An output of one video of a batch, from which a `BatchTotal` is made.

    Attributes
    ----------
    path
        The output.
    place
        Where it lies as seen from the folder of the total.
    summary
        What the sink returned as its `summary`; None if it is not known.
    """

    path: Path
    place: Path
    summary: Mapping[str, Any] | None = None


@dataclass(frozen=True, slots=True)
class BatchTotal:
    """A file over all videos of a batch, made from the outputs of each.

    Attributes
    ----------
    name
        Its name in the folder of the batch, without suffix.
    write
        Function that gets the outputs that exist, by the name of their video (as in the folder of
        the batch, without suffix), and the file to write.
    suffix
        Suffix of the file; None for that of the outputs.
    """

    name: str
    write: Callable[[Mapping[str, VideoPart], Path], None]
    suffix: str | None = None


@dataclass(frozen=True, slots=True)
class SinkKind:
    """A kind of sink, which is registered under a name.

    Attributes
    ----------
    open
        Function that takes the path of the output and a `SinkContext`, and returns the sink.
    suffixes
        What the name of the output may end in, lower case, such as ".csv" or ".coco.json", or a
        function that returns it; empty for any.
    what
        Noun for what it writes, for messages: "tracks".
    marker
        Only if the output is a folder, which is made: pattern of the files in it. If there is such
        a file, the folder is the output of an earlier run.
    writes_standard_output
        Whether the path `-` means standard output.
    one_frame
        Whether it takes only the frame at `SinkContext.at`. If all outputs of a run do, no other
        frames are read than it needs.
    takes
        "videos" or "pictures" if the sink can take results of these only.
    may_replace
        Says whether `--overwrite` may replace a file that is there. `OutputFiles.stage` takes it
        too, for a file that appears during the run.
    total
        What a batch writes in addition, over all its videos.
    """

    open: Callable[[Path, SinkContext], Sink]
    suffixes: Sequence[str] | Callable[[], Sequence[str]] = ()
    what: str = "outputs"
    marker: str = ""
    writes_standard_output: bool = False
    one_frame: bool = False
    takes: Literal["videos", "pictures", "both"] = "both"
    may_replace: MayReplace = any_file
    total: BatchTotal | None = None

    @property
    def endings(self) -> Sequence[str]:
        """What the name of the output may end in; empty for any."""
        return self.suffixes() if callable(self.suffixes) else self.suffixes

    def takes_name(self, name: str) -> bool:
        """Return whether an output may have this name, without its folder."""
        if self.writes_standard_output and name == STANDARD_OUTPUT.name:
            return True
        ends = [len(each) for each in self.endings if name.lower().endswith(each)]
        return not self.endings or 0 < max(ends, default=0) < len(name)


def sink_kind(name: str) -> SinkKind:
    """Return the kind of sink with this name. Raises `ConfigError` if there is none."""
    kind: SinkKind = load_plugin(SINKS, name)
    return kind


def check_sinks(outputs: Sequence[Output], *, overwrite: bool, makes_folder: bool = False) -> None:
    """Refuse outputs that cannot be written, before any work; arguments as in `check_output`.

    Raises
    ------
    OutputError
        Two outputs have one path, a suffix is not one of the sink's, or an output cannot be written
        or exists already.
    ConfigError
        There is no sink with such a name.
    """
    seen: set[Path] = set()
    for output in outputs:
        kind, path = _kind_for(output), output.path
        if path.resolve() in seen:
            raise OutputError(f"{path}: is given for two outputs; name another file for one")
        seen.add(path.resolve())
        if path == STANDARD_OUTPUT and kind.writes_standard_output:
            continue
        if kind.marker:
            path = min(path.glob(kind.marker), default=path / kind.marker)
        check_output(
            path,
            overwrite=overwrite,
            makes_folder=makes_folder or bool(kind.marker),
            may_replace=kind.may_replace,
        )


def output_state(output: Output) -> tuple[int, int] | None:
    """Return the bytes of an output and the time of its last change; None if it is not there.

    The time is in nanoseconds since 1970. Of a folder they are the sum and the latest of the files
    in it that the sink writes.
    """
    marker, path = sink_kind(output.sink).marker, output.path
    if not (os.path.isdir if marker else os.path.isfile)(path):  # its name may be too long
        return None
    states = [file.stat() for file in (path.glob(marker) if marker else [path])]
    return sum(s.st_size for s in states), max((s.st_mtime_ns for s in states), default=0)


def open_sink(output: Output, context: SinkContext) -> "_NamedSink":
    """Open the sink of an output. An `OSError` of the sink becomes an `OutputError` with its path.

    Raises
    ------
    OutputError
        The sink does not take such results, the suffix is not one of the sink's, or the output
        cannot be written.
    ConfigError
        There is no sink with that name.
    """
    kind = _kind_for(output)
    source = "pictures" if context.video is None else "videos"
    if kind.takes not in ("both", source):
        raise OutputError(f"{output.path}: the sink {output.sink} is for {kind.takes}")
    with output_errors(output.path):
        return _NamedSink(kind.open(output.path, context), output.path)


@contextmanager
def open_sinks(outputs: Iterable[Output], context: SinkContext) -> Iterator[list["_NamedSink"]]:
    """Open the sinks of several outputs; errors as of `open_sink`."""
    with ExitStack() as stack:
        yield [stack.enter_context(open_sink(output, context)) for output in outputs]


def of_files(join: Callable[[Mapping[str, Path], Path], None]) -> BatchTotal:
    """Return the total `all` that a function makes from the files of all videos."""

    def write(parts: Mapping[str, VideoPart], target: Path) -> None:
        join({name: part.path for name, part in parts.items()}, target)

    return BatchTotal("all", write)


class _NamedSink:
    """A `Sink` whose `OSError` becomes an `OutputError` with the path of its output."""

    def __init__(self, sink: Sink, path: Path) -> None:
        self._sink = sink
        self._path = path

    def __enter__(self) -> Self:
        with output_errors(self._path):
            self._sink.__enter__()
        return self

    def __exit__(self, *raised: Any) -> None:
        with output_errors(self._path):
            self._sink.__exit__(*raised)

    def write(self, result: FrameResult) -> None:
        with output_errors(self._path):
            self._sink.write(result)

    @property
    def summary(self) -> Mapping[str, Any] | None:
        return getattr(self._sink, "summary", None)


def _kind_for(output: Output) -> SinkKind:
    """Return the kind of an output's sink; refuse a suffix that is not one of the sink's."""
    kind, path = sink_kind(output.sink), output.path
    if not kind.takes_name(path.name):
        names = ", ".join(kind.endings)
        raise OutputError(f"{path}: {kind.what} are written as {names}; name it so")
    return kind
