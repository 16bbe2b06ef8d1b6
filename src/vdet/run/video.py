"""A run: read a video, search its frames, follow the vehicles, and give the results to sinks."""

import logging
import time
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from vdet.boxes import NO_BOXES
from vdet.conditions.finding import Finding
from vdet.config.schema import Settings
from vdet.detect.factory import as_model
from vdet.detect.protocol import DetectorModel, stage_pictures_of
from vdet.errors import FrameSizeError, VideoError, check_positive
from vdet.files import OutputFiles, record_input, recorded_inputs
from vdet.media.reader import VideoReader
from vdet.progress import Progress, no_progress
from vdet.run.loop import Pipeline, build, named_errors, peek
from vdet.run.result import FrameResult
from vdet.run.sinks.protocol import Output, SinkContext, check_sinks, open_sinks, sink_kind
from vdet.run.steps import Step
from vdet.run.threads import StalledError, prefetch
from vdet.track.track import VideoTracker
from vdet.traffic.clock import Clock, find_clock
from vdet.traffic.live import LiveTraffic
from vdet.workers import core_count, return_freed_memory

log = logging.getLogger("vdet")

LEAD = Fraction(2)
"""Seconds before the frame at `Run.at` that are processed too, for detector and tracker."""

IO_TIMEOUT = 120.0  # seconds


@dataclass(frozen=True, slots=True)
class Run:
    """A run: a video, the part of it that is processed, the settings and the outputs.

    Attributes
    ----------
    settings
        All that the results depend on, beside the video and the part.
    start, end
        Seconds from the first frame; frames with start ≤ time < end are processed.
    frames
        Largest number of frames to process.
    at
        Time of the stage pictures, seconds from the first frame. If no output needs more, only the
        frames from 2 s before it are processed.
    overwrite
        Replace outputs that are there already.
    threads
        Number of threads that search; None for one per core.
    codec_threads
        Number of threads of the encoder; None for one per core.
    timeout
        Seconds in which the next frame must be read or written. After that the run fails, so that
        a disk or a network that hangs does not stop a batch. Reading gets the duration of the part
        before `start` in addition.
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
    codec_threads: int | None = None
    timeout: float = IO_TIMEOUT

    def __post_init__(self) -> None:
        check_positive(frames=self.frames, threads=self.threads)

    @property
    def is_part(self) -> bool:
        """Whether only a part of the video is processed."""
        return (self.start, self.end, self.frames) != (None, None, None)

    @property
    def shows_at(self) -> bool:
        """Whether an output shows the frame at `at`."""
        return any(sink_kind(output.sink).one_frame for output in self.outputs)


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
        When the video was recorded, if that is known.
    findings
        What makes the results doubtful.
    summaries
        What sinks say of their outputs, by the path of the output.
    """

    width: int
    height: int
    frames: int
    tracks: int
    seconds: float
    clock: Clock | None = None
    summaries: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()


@dataclass(frozen=True, slots=True)
class OpenVideo:
    """A video that is being read, the results of its frames, and what reads all its tracks."""

    reader: VideoReader
    pipeline: Pipeline
    results: Generator[FrameResult]
    traffic: LiveTraffic


def check_run(run: Run) -> None:
    """Refuse a run whose outputs cannot be written, before any work. Raises `OutputError`."""
    record_input(run.source)
    check_sinks(run.outputs, overwrite=run.overwrite)


@contextmanager
def open_video(
    run: Run,
    model: DetectorModel,
    *,
    tracker: VideoTracker | None = None,
    steps: Sequence[Step] = (),
) -> Iterator[OpenVideo]:
    """Open a video, and follow the vehicles through it; parameters and errors as in `run_video`.

    Reading and searching run in threads.
    """
    timeout = run.timeout + float(run.start or 0)
    reading = _reader_and_frames(run)
    try:
        with named_errors(run.source, VideoError), prefetch(reading, timeout=timeout) as read:
            reader: VideoReader = next(read)
            latest = max(run.start or Fraction(0), run.at if run.shows_at else Fraction(0))
            if reader.length is not None and latest >= reader.length:
                raise _no_frame(run, f"{float(latest):.2f} s is beyond its end", reader.length)
            images, frames = peek(read)
            settings, info = run.settings, reader.info
            try:
                pipeline = build(model, settings, info, images, tracker=tracker, steps=steps)
            except FrameSizeError as error:
                log.warning("%s: gets no boxes: %s", run.source, error)
                pipeline = build(as_model(lambda _: NO_BOXES), settings, info, images)
            traffic = LiveTraffic(settings, info.width, info.height)
            del images  # otherwise they stay in memory for the whole run
            threads = run.threads or core_count()
            with closing(pipeline.follow(frames, run.source, threads=threads)) as results:
                yield OpenVideo(reader, pipeline, results, traffic)
    except StalledError as error:
        raise VideoError(
            f"{run.source}: nothing was read or written for {timeout:g} s; check the disk"
        ) from error


def _reader_and_frames(run: Run) -> Generator[Any]:
    """Yield the reader, and then its frames; the thread that reads them opens and closes it."""
    with VideoReader(
        run.source, start=run.start, end=run.end, frames=run.frames, settings=run.settings.input
    ) as reader:
        yield reader
        yield from reader


@recorded_inputs()
def run_video(
    run: Run,
    model: DetectorModel,
    *,
    tracker: VideoTracker | None = None,
    steps: Sequence[Step] = (),
    progress: Progress = no_progress,
) -> RunTotals:
    """Run a run. Its outputs appear under their names together, at the end of the run.

    Reading, searching and encoding run in threads, tracking and drawing in the calling one.

    Parameters
    ----------
    tracker, steps
        As `vdet.run.loop.build` takes them.
    progress
        Called once with the expected number of frames (None: unknown). What it returns is called
        with the number of frames done since the last call.

    Raises
    ------
    VideoError
        The video cannot be read, too much of it is damaged, or the regions, the lines or the camera
        do not fit its frames.
    OutputError
        An output cannot be written.

    No output is left after an error.
    """
    began = time.perf_counter()
    return_freed_memory()
    only_at = run.shows_at and all(sink_kind(each.sink).one_frame for each in run.outputs)
    if only_at and run.frames is None:
        run = replace(run, start=max(run.at - LEAD, run.start or Fraction(0)))
    with (
        OutputFiles(overwrite=run.overwrite) as files,
        open_video(run, model, tracker=tracker, steps=steps) as video,
        open_sinks(run.outputs, context := _context(run, files, video)) as sinks,
    ):
        info = video.reader.info
        advance = progress(None if only_at else video.reader.expected)
        frames, writing, last, ids = 0, 0.0, None, set[int]()
        for result in video.results:
            video.traffic.add(result.frame_tracks)
            written = time.perf_counter()
            for sink in sinks:
                sink.write(result)
            writing += time.perf_counter() - written
            ids.update(track.id for track in result.tracks)
            frames += 1
            advance(1)
            if result.searched:
                last = result.frame.time - info.start
                if only_at and last >= run.at:
                    break
        if last is None or (run.shows_at and last < run.at):
            when = "in the times given" if last is None else f"at {float(run.at):.2f} s or later"
            raise _no_frame(run, f"no frame is read {when}", video.reader.length)
        counts = video.traffic.counts()
        for warning in counts.warnings if counts else ():
            log.warning("%s: %s", run.source, warning)
    seconds = time.perf_counter() - began
    log.info(
        "%s: finding the vehicles took %.1f s, drawing and writing them %.1f s",
        *(run.source, seconds - writing, writing),
    )
    pairs = zip(run.outputs, sinks, strict=True)
    summaries = {str(output.path): sink.summary for output, sink in pairs if sink.summary}
    size, found = (info.width, info.height), (context.clock, summaries, context.findings)
    return RunTotals(*size, frames, len(ids), seconds, *found)


def _context(run: Run, files: OutputFiles, video: OpenVideo) -> SinkContext:
    info = video.reader.info
    return SinkContext(
        files,
        run.settings,
        info,
        is_part=run.is_part,
        at=run.at,
        threads=run.codec_threads or core_count(),
        clock=find_clock(run.source, run.settings, info.tags.creation_time, float(info.start)),
        timeout=run.timeout,
        outputs=run.outputs,
        traffic=video.traffic,
        conditions=video.pipeline.conditions,
        stage_pictures=stage_pictures_of(video.pipeline.detector),
    )


def _no_frame(run: Run, words: str, length: Fraction | None) -> VideoError:
    """Return the error of a time at which there is no frame."""
    end = "check them" if length is None else f"it ends at {float(length):.2f} s"
    return VideoError(f"{run.source}: {words}; {end}")
