"""The protocol of outputs (sinks), their kinds, and how outputs are checked and opened."""

import os
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol, Self

import cv2
import numpy as np

from vdet.boxes import Image
from vdet.config.schema import Settings
from vdet.detect.detectors import StageImages
from vdet.errors import OutputError
from vdet.files import OutputFiles, output_errors
from vdet.media import VideoInfo
from vdet.media.images import coarse_scale, shrunk
from vdet.plugins import SINKS, load_plugin
from vdet.run.sinks import Output
from vdet.run.steps import Fact, FrameResult

if TYPE_CHECKING:  # an image needs no traffic: a tenth of the time of `detect-image`
    from vdet.review.corrections import Corrections
    from vdet.traffic.counter import LiveTraffic
    from vdet.traffic.records import BestCrops, VehicleRecord
    from vdet.traffic.survey import Survey

STANDARD_OUTPUT = Path("-")

Writing = Generator[None, FrameResult | None, Any]
"""What the function of a `sink` does: it receives results, and None if a run ends without an error.

It returns the `summary` of the output: see `BaseSink`.
"""


class Sink(AbstractContextManager["Sink"], Protocol):
    """Receives the results of a run, frame by frame; a context manager.

    It writes into temporary files from `SinkContext.files`. They appear under their names when the
    whole run succeeds, and not at all otherwise. When the `with` block of the sink ends without an
    error, its files must be complete.
    """

    def write(self, result: FrameResult) -> None:
        """Receive the next result, without changing the frame's image."""


@dataclass(frozen=True)
class SinkContext:
    """What a sink receives when it is opened, and what the sinks of a run share.

    Attributes
    ----------
    files
        Provides temporary files: `files.stage(path)`.
    video
        The video that is read; None for single images.
    is_part
        Whether only a part of the video is read.
    start, end
        That part, seconds from the first frame; None: no limit.
    at
        `Run.at`: seconds from the first frame.
    outputs
        All outputs of the run, for a sink that refers to another.
    traffic
        Counts and speeds up to the latest result, and the records of vehicles, which are known when
        sinks finish; None for single images.
    corrections
        What reviewers say of the counts.
    facts
        Results of steps about the whole video, by name; empty before sinks finish. Sinks that
        finish first may add to them.
    clip_files
        The clip of a vehicle by its id, once the sink that writes it has finished.
    places
        For single images: their paths below the input folders.
    stage_images
        Takes the image of a frame and its detections; returns an image of each stage of the
        detector by its name, in order.
    """

    files: OutputFiles
    settings: Settings
    video: VideoInfo | None = None
    is_part: bool = False
    start: Fraction | None = None
    end: Fraction | None = None
    at: Fraction = Fraction(0)
    outputs: tuple[Output, ...] = ()
    traffic: "LiveTraffic | None" = None
    corrections: "Corrections | None" = None
    facts: dict[str, Fact] = field(default_factory=dict)
    clip_files: dict[int, Path] = field(default_factory=dict)
    places: Mapping[Path, Path] = field(default_factory=dict)
    stage_images: StageImages = lambda *_: {}

    def path_of(self, sink: str, *, in_batch: bool = False) -> Path | None:
        """Return the output of a sink, or its file over all videos of the batch."""
        outputs = (output for output in self.outputs if output.sink == sink)
        return next((output.total if in_batch else output.path for output in outputs), None)

    @property
    def of_video(self) -> tuple[VideoInfo, "LiveTraffic"]:
        """The video and its traffic, for sinks that do not accept images."""
        assert self.video is not None  # `SinkKind.takes` says so
        assert self.traffic is not None
        return self.video, self.traffic

    @cached_property
    def poster(self) -> "Poster":
        """The frame with the most vehicles; sinks that use it add each result."""
        return Poster(is_coarse=self.settings.output.coarse)

    @cached_property
    def crops(self) -> "BestCrops":
        """The best image of each vehicle; sinks that use them add each result."""
        from vdet.traffic.records import BestCrops

        return BestCrops(is_coarse=self.settings.output.coarse)

    @cached_property
    def survey(self) -> "Survey | None":
        """The tables of the counts, once sinks finish; None without lines and zones."""
        from vdet.traffic.survey import Survey

        counts = self.traffic.counts() if self.traffic else None
        return Survey({self.video.name: counts}, self.settings) if counts and self.video else None


class Poster:
    """The frame that pages and workbooks show: the one with the most vehicles.

    `is_coarse` is `output.coarse`.
    """

    def __init__(self, *, is_coarse: bool) -> None:
        self._is_coarse = is_coarse
        self._best: FrameResult | None = None

    def add(self, result: FrameResult) -> None:
        """Add a frame."""
        if self._best is None or len(result.tracks) > len(self._best.tracks):
            self._best = result

    def image(self, vehicles: Iterable["VehicleRecord"]) -> Image | None:
        """Return the frame, BGR uint8, at its own size; None without frames.

        `vehicles` are all of the video: no detail is kept that would show their plates.
        """
        if self._best is None:
            return None
        image, boxes = self._best.frame.image, [vehicle.largest for vehicle in vehicles]
        if not self._is_coarse:
            return image
        height, width = image.shape[:2]
        largest = max((side for box in boxes for side in (box.width, box.height)), default=0)
        reduced = shrunk(image, coarse_scale(largest, height))
        return np.asarray(cv2.resize(reduced, (width, height)), np.uint8)  # marks are drawn on it

    def with_boxes(self, image: Image | None) -> Image | None:
        """Return a copy of the frame, as `image` returns it, with a box around each vehicle."""
        if self._best is None or image is None:
            return None
        drawn = image.copy()
        self._best.draw_tracks(drawn, ())
        return drawn


class BaseSink:
    """Base of sinks that are classes: `finish` is called when the run ends without an error.

    `summary` is what a file over all videos of a batch needs from the output, as values for JSON.
    """

    summary: Any = None

    def __init__(self, path: Path, context: SinkContext) -> None:
        self.path = path
        self.context = context

    @property
    def video(self) -> VideoInfo:
        """The video, for sinks that do not accept images."""
        return self.context.of_video[0]

    @property
    def traffic(self) -> "LiveTraffic":
        """Counts, speeds and records of the video, for sinks that do not accept images."""
        return self.context.of_video[1]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: Any, *_: object) -> None:
        if kind is None:
            self.finish()

    def write(self, result: FrameResult) -> None:
        """Receive the next result."""

    def finish(self) -> None:
        """Write everything that is left."""


class _FunctionSink:
    """A sink that is a function: see `Writing`."""

    summary: Any = None

    def __init__(self, writing: Writing) -> None:
        self._writing = writing

    def __enter__(self) -> Self:
        next(self._writing)
        return self

    def __exit__(self, kind: Any, *_: object) -> None:
        if kind is not None:
            return self._writing.close()
        try:
            self._writing.send(None)
        except StopIteration as end:
            self.summary = end.value

    def write(self, result: FrameResult) -> None:
        self._writing.send(result)


@dataclass(frozen=True, slots=True)
class BatchTotal:
    """A file over all videos of a batch, made from the summaries of the sinks.

    Attributes
    ----------
    name
        Its name in the folder of the batch, without suffix.
    write
        Function that takes the `summary` of each existing output, by the name of its video (its
        path in the folder of the batch, without suffix), and the file to write.
    suffix
        Suffix of the file; None: the suffix of the outputs.
    of_failed
        Function that returns the `summary` of a video that failed, from its error; None: such a
        video is left out.
    """

    name: str
    write: Callable[[Mapping[str, Any], Path], None]
    suffix: str | None = None
    of_failed: Callable[[str], Any] | None = None


@dataclass(frozen=True, slots=True)
class SinkKind:
    """A kind of sink, as registered under its name.

    Attributes
    ----------
    open
        Function that takes the path of the output and a `SinkContext`, and returns the sink.
    suffixes
        Allowed endings of the name of the output, lower case, such as ".csv" or ".coco.json", or a
        function that returns them; empty for any.
    what
        Noun for the output in messages: "tracks".
    folder_pattern
        Only if the output is a folder: pattern of the files that the sink writes into it. A folder
        with such a file is the output of an earlier run.
    writes_standard_output
        Whether the path `-` means standard output.
    takes
        "videos" or "images" if the sink accepts only results of videos, or only of images.
    uses_traffic
        Whether it uses `SinkContext.traffic`, apart from the clock. If no sink does, a run counts
        and records vehicles only if the settings have lines or zones.
    may_replace
        Whether `--overwrite` may replace a file.
    check
        Raises `OutputError` if an output cannot be written for another reason.
    total
        The file that a batch writes over all its videos.
    finish_order
        Sinks with a lower number finish first: with -1, a sink that finds facts and counts for the
        files of other sinks; with 1, a sink that links to these files.
    """

    open: Callable[[Path, SinkContext], Sink]
    suffixes: Sequence[str] | Callable[[], Sequence[str]] = ()
    what: str = "outputs"
    folder_pattern: str = ""
    writes_standard_output: bool = False
    takes: Literal["videos", "images", "both"] = "both"
    uses_traffic: bool = True
    may_replace: Callable[[Path], bool] = lambda _: True
    check: Callable[[Path], object] = lambda _: None
    total: BatchTotal | None = None
    finish_order: int = 0

    @property
    def endings(self) -> Sequence[str]:
        """Allowed endings of the name of the output; empty for any."""
        return self.suffixes() if callable(self.suffixes) else self.suffixes

    def takes_name(self, name: str) -> bool:
        """Return whether an output may have this name, without its folder."""
        if self.writes_standard_output and name == STANDARD_OUTPUT.name:
            return True
        lengths = [len(ending) for ending in self.endings if name.lower().endswith(ending)]
        return not self.endings or 0 < max(lengths, default=0) < len(name)


def sink(**attributes: Any) -> Callable[[Callable[[Path, SinkContext], Writing]], SinkKind]:
    """Return a decorator for a generator function: the kind of sink that writes as it does.

    `attributes` are those of `SinkKind`.
    """

    def decorate(function: Callable[[Path, SinkContext], Writing]) -> SinkKind:
        def open_sink(path: Path, context: SinkContext) -> Sink:
            return _FunctionSink(function(path, context))

        return SinkKind(open_sink, **attributes)

    return decorate


def sink_kind(name: str) -> SinkKind:
    """Return the kind of sink with this name. Raises `ConfigError` if it is unknown."""
    kind: SinkKind = load_plugin(SINKS, name)
    return kind


def check_sinks(
    outputs: Sequence[Output], files: OutputFiles, *, makes_folder: bool = False
) -> None:
    """Reject outputs that cannot be written, before any work: see `OutputFiles.check`.

    Raises
    ------
    OutputError
        Two outputs have the same path, an ending is not one of the sink's, or an output cannot be
        written or already exists.
    ConfigError
        A sink is unknown.
    """
    for output in outputs:
        kind, path = sink_kind(output.sink), output.path
        if not kind.takes_name(path.name):
            raise OutputError(f"{path}: {kind.what} must end in {', '.join(kind.endings)}")
        kind.check(path)
        if path == STANDARD_OUTPUT and kind.writes_standard_output:
            files.claim(path)
            continue
        written = [path]
        if kind.folder_pattern:
            files.claim(path)
            written = sorted(path.glob(kind.folder_pattern)) if os.path.isdir(path) else []  # noqa: PTH112
            path = next(iter(written), path / kind.folder_pattern)
        files.check(path, makes_folder=makes_folder or bool(kind.folder_pattern))
        for path in filter(os.path.lexists, written):
            if (kind.folder_pattern and path.is_symlink()) or not kind.may_replace(path):
                advice = "was not written by vdet and will not be replaced; choose another name"
                raise OutputError(f"{path}: {advice}")


def output_state(output: Output, staged: Path | None = None) -> tuple[int, int] | None:
    """Return the size in bytes and modification time of an output; None if it does not exist.

    The time is in nanoseconds since 1970. For a folder, they are the sum and the latest of the
    files written by the sink. A staged output is at `staged`.
    """
    pattern, path = sink_kind(output.sink).folder_pattern, staged or output.path
    if not (os.path.isdir if pattern else os.path.isfile)(path):  # its name may be too long
        return None
    states = [file.stat() for file in (path.glob(pattern) if pattern else [path])]
    return sum(s.st_size for s in states), max((s.st_mtime_ns for s in states), default=0)


class Sinks:
    """The open sinks of several outputs, which receive the same results."""

    def __init__(self, sinks: Mapping[Path, Sink]) -> None:
        self._sinks = sinks

    def write(self, result: FrameResult) -> None:
        """Pass a result to all of them. Raises `OutputError`."""
        for path, sink in self._sinks.items():
            with output_errors(path):
                sink.write(result)

    @property
    def summaries(self) -> dict[Path, Any]:
        """The `summary` of each, by the path of its output."""
        return {path: getattr(sink, "summary", None) for path, sink in self._sinks.items()}


@contextmanager
def open_sinks(outputs: Iterable[Output], context: SinkContext) -> Iterator[Sinks]:
    """Open the sinks of several outputs; an `OSError` becomes an error of the output.

    Raises
    ------
    OutputError
        A sink does not accept such results, or an output cannot be written.
    ConfigError
        A sink is unknown.
    """
    source = "images" if context.video is None else "videos"
    sinks = {}
    with ExitStack() as stack:
        # What is opened first is closed last.
        for output in sorted(outputs, key=lambda output: -sink_kind(output.sink).finish_order):
            kind = sink_kind(output.sink)
            if kind.takes not in ("both", source):
                raise OutputError(f"{output.path}: the sink {output.sink} is for {kind.takes}")
            stack.enter_context(output_errors(output.path))
            sinks[output.path] = stack.enter_context(kind.open(output.path, context))
        yield Sinks(sinks)
