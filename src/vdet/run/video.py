"""A run: read a video, search its frames, track the vehicles, and pass the results to sinks."""

import logging
import time
from collections.abc import Generator, Iterator, Mapping
from contextlib import AbstractContextManager, closing, contextmanager
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from vdet.boxes import NO_BOXES
from vdet.config.schema import Settings
from vdet.detect.factory import as_model, load_detector
from vdet.detect.protocol import VideoDetector, stage_images_of, warnings_of
from vdet.errors import ConfigError, FrameSizeError, VideoError
from vdet.files import FileIds, OutputFiles, valid_text
from vdet.findings import Finding
from vdet.media.reader import VideoReader
from vdet.progress import Progress, no_progress
from vdet.run.inputs import input_files
from vdet.run.loop import Parts, build, named_errors, peek
from vdet.run.result import FINDINGS, Fact, Facts, FrameResult, findings_in
from vdet.run.sinks import Output
from vdet.run.sinks.protocol import SinkContext, check_sinks, open_sinks, sink_kind
from vdet.run.threads import read_async
from vdet.traffic.clock import Clock, find_clock
from vdet.traffic.counts import Corrected, Counts
from vdet.traffic.live import LiveTraffic
from vdet.traffic.records import VehicleRecord
from vdet.workers import core_count

log = logging.getLogger("vdet")


@dataclass(frozen=True, slots=True)
class Run:
    """A run: a video, the part to process, the settings and the outputs.

    Attributes
    ----------
    settings
        Everything that the results depend on, besides the video and the part.
    start, end
        Seconds from the first frame; frames with start ≤ time < end are processed.
    frames
        Maximum number of frames to process.
    at
        Time of the stage images, seconds from the first frame.
    overwrite
        Replace existing outputs.
    threads
        Number of threads for the search; None for one per core.
    settings_files
        The files that the settings were read from; no output replaces them.
    corrections
        Files of corrections of its counts.
    """

    source: Path
    outputs: tuple[Output, ...] = ()
    settings: Settings = field(default_factory=Settings)
    start: Fraction | None = None
    end: Fraction | None = None
    frames: int | None = None
    at: Fraction = Fraction(0)
    overwrite: bool = False
    threads: int | None = None
    settings_files: tuple[Path, ...] = ()
    corrections: tuple[Path, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "source", Path(self.source))  # notebooks pass text
        for name, number in (("frames", self.frames), ("threads", self.threads)):
            if number is not None and number < 1:
                raise ConfigError(f"{name}: is {number}; must be at least 1")

    @property
    def is_part(self) -> bool:
        """Whether only a part of the video is processed."""
        return (self.start, self.end, self.frames) != (None, None, None)

    @property
    def inputs(self) -> FileIds:
        """The files that the run reads, which no output replaces. Raises `VideoError`."""
        files = (*self.settings_files, *self.corrections)
        return input_files(self.source, *files, settings=self.settings)


@dataclass(frozen=True, slots=True)
class RunTotals:
    """Totals of a run.

    Attributes
    ----------
    width, height
        Size of the upright frames, pixels.
    frames, tracks
        Number of frames processed, and of tracks shown (ids).
    seconds
        Wall time.
    clock
        When the video was recorded; None if unknown.
    corrected
        How its counts were corrected; None if they were not.
    facts
        Results of steps about the whole video, by name.
    summaries
        The `BaseSink.summary` of each output, by its path.
    """

    width: int
    height: int
    frames: int
    tracks: int
    seconds: float
    clock: Clock | None = None
    corrected: Corrected | None = None
    facts: Facts = field(default_factory=dict)
    summaries: Mapping[Path, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class OpenVideo:
    """A video that is being read.

    Attributes
    ----------
    results
        The results of its frames, in order.
    traffic
        Counts, speeds and records of the results so far, if `open_video` was called with them.
    facts
        Results of steps about the whole video, by name; empty before the last frame.
    """

    reader: VideoReader
    detector: VideoDetector
    results: Generator[FrameResult]
    traffic: LiveTraffic
    facts: dict[str, Fact]


@contextmanager
def open_video(
    run: Run, parts: Parts | None = None, *, with_traffic: bool = True
) -> Iterator[OpenVideo]:
    """Open a video, and track the vehicles in it; parameters and errors as for `run_video`.

    Reading and searching run in threads. Without `with_traffic`, nothing is counted or recorded.
    """
    parts = parts or Parts(load_detector(run.settings.detector))
    corrections = None
    if run.corrections:  # most runs have none, and load nothing for them
        from vdet.traffic.corrections import by_video, read_corrections

        name, reviews = valid_text(run.source.name), read_corrections(run.corrections)
        corrections = by_video(reviews, {name: name}, run.settings.traffic)[name]
    with named_errors(run.source, VideoError), read_async(_opened(run)) as (reader, read):
        images, frames = peek(read)
        settings, info = run.settings, reader.info
        try:
            pipeline = build(parts, settings, info, images)
        except FrameSizeError as error:
            log.warning("%s: no vehicles can be detected: %s", run.source, error)
            pipeline = build(Parts(as_model(lambda _: NO_BOXES)), settings, info, images)
        del images  # otherwise they stay in memory for the whole run
        clock = find_clock(
            run.source, settings, float(info.start), tags=info.tags, length=info.duration
        )
        traffic = LiveTraffic(settings, info.width, info.height, clock, corrections=corrections)
        facts: dict[str, Fact] = {}

        def results() -> Generator[FrameResult]:
            threads = run.threads or core_count()
            with closing(pipeline.follow(frames, run.source, threads=threads)) as completed:
                for result in completed:
                    if with_traffic:
                        traffic.add(result.frame_tracks)
                    yield result.of_classes(settings.classes)
            facts.update(pipeline.facts())
            for warning in warnings_of(parts.model):
                log.warning("%s: %s", run.source, warning)
            if with_traffic:
                traffic.end(findings_in(facts))
                if counts := traffic.counts():
                    facts[FINDINGS] = replace(findings_in(facts), items=counts.findings)

        with closing(results()) as every_result:
            yield OpenVideo(reader, pipeline.detector, every_result, traffic, facts)


@contextmanager
def _opened(run: Run) -> Iterator[VideoReader]:
    """Open the video when the block begins: in the thread that reads it."""
    with VideoReader(
        run.source, start=run.start, end=run.end, frames=run.frames, settings=run.settings.input
    ) as reader:
        yield reader


class Results(Iterator[FrameResult]):
    """The results of a video, frame by frame, and their totals.

    `video` is the value of `open_video`. It is opened when the first result is requested; errors as
    for `open_video`.
    """

    _video: OpenVideo | None = None

    def __init__(self, video: AbstractContextManager[OpenVideo]) -> None:
        self._results = self._read(video)

    def _read(self, video: AbstractContextManager[OpenVideo]) -> Generator[FrameResult]:
        with video as self._video:
            yield from self._video.results

    def __next__(self) -> FrameResult:
        return next(self._results)

    def close(self) -> None:
        """Close the video before its last frame."""
        self._results.close()

    @property
    def counts(self) -> Counts | None:
        """The counts so far at the lines and in the zones of the settings; None without any."""
        return self._video.traffic.counts() if self._video else None

    @property
    def vehicles(self) -> tuple[VehicleRecord, ...]:
        """A record of each vehicle, by id; empty before the last frame."""
        return self._video.traffic.vehicles if self._video else ()

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Reasons to doubt the results; empty before the last frame."""
        return findings_in(self._video.facts).items if self._video else ()


def run_video(
    run: Run, parts: Parts | None = None, *, progress: Progress = no_progress, is_last: bool = False
) -> RunTotals:
    """Process a run. Its outputs appear together, at the end of the run.

    Reading, searching and encoding run in threads, tracking and drawing in the calling thread.

    Parameters
    ----------
    parts
        The detector, the tracker and further steps; None: as the settings say.
    progress
        Called once, with the expected number of frames, for the progress.
    is_last
        As for `vdet.files.OutputFiles`.

    Raises
    ------
    VideoError
        The video cannot be read, too much of it is damaged, or the regions, the lines or the camera
        do not fit its frames.
    OutputError
        An output cannot be written; raised before any work if possible.

    No output is left after an error.
    """
    files = OutputFiles(overwrite=run.overwrite, inputs=run.inputs, is_last=is_last)
    check_sinks(run.outputs, files)
    with files:
        return write_outputs(run, files, parts, progress=progress)


def write_outputs(
    run: Run, files: OutputFiles, parts: Parts | None, *, progress: Progress = no_progress
) -> RunTotals:
    """Do as `run_video`, but leave the complete outputs in `files`, under temporary names.

    Other parameters and errors as for `run_video`.
    """
    start_time = time.perf_counter()
    kinds = [sink_kind(output.sink) for output in run.outputs]
    with_traffic = bool(run.settings.traffic) or any(kind.uses_traffic for kind in kinds)
    with open_video(run, parts, with_traffic=with_traffic) as video:
        info, frames, ids = video.reader.info, 0, set[int]()
        context = SinkContext(
            files,
            run.settings,
            info,
            is_part=run.is_part,
            start=run.start,
            end=run.end,
            at=run.at,
            outputs=run.outputs,
            traffic=video.traffic,
            facts=video.facts,
            stage_images=stage_images_of(video.detector),
        )
        with open_sinks(run.outputs, context) as sinks:
            advance = progress("", video.reader.expected)
            for result in video.results:
                sinks.write(result)
                ids.update(track.id for track in result.tracks)
                frames += 1
                advance(1)
            if not frames:
                raise _no_frame(run, video.reader)
        counts = video.traffic.counts()
        for warning in (line for fact in video.facts.values() for line in str(fact).splitlines()):
            log.warning("%s: %s", run.source, warning)
    return RunTotals(
        width=info.width,
        height=info.height,
        frames=frames,
        tracks=len(ids),
        seconds=time.perf_counter() - start_time,
        clock=video.traffic.clock,
        corrected=counts.corrected if counts else None,
        facts=video.facts,
        summaries=sinks.summaries,
    )


def _no_frame(run: Run, reader: VideoReader) -> VideoError:
    """Return the error for times without a frame."""
    first, words = max(run.start or Fraction(0), run.at), "no frames at these times"
    if reader.length is None:
        return VideoError(f"{run.source}: {words}; check them")
    if first >= reader.length:
        words = f"{float(first):.2f} s is beyond its end"
    return VideoError(f"{run.source}: {words}; it ends at {float(reader.length):.2f} s")
