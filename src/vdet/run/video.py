"""A run: read a video, search its frames, follow the vehicles, and give the results to sinks."""

import logging
import time
from collections.abc import Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vdet.boxes import NO_BOXES
from vdet.config.schema import Settings
from vdet.detect.factory import as_model
from vdet.detect.protocol import DetectorModel, stage_pictures_of
from vdet.errors import FrameSizeError, VideoError
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
from vdet.workers import core_count, return_freed_memory

if TYPE_CHECKING:
    from vdet.lanes.ground import GroundRequest
    from vdet.lanes.road import LaneRequest
    from vdet.traffic.counter import VehicleCounter

log = logging.getLogger("vdet")

LEAD = Fraction(2)
"""Seconds before the frame at `VideoJob.at` that are processed too, for detector and tracker."""

IO_TIMEOUT = 120.0  # seconds


@dataclass(frozen=True, slots=True)
class VideoJob:
    """A video, the part of it that is processed, and the outputs.

    Attributes
    ----------
    start, end
        Seconds from the first frame; frames with start ≤ time < end are processed.
    frames
        Largest number of frames to process.
    at
        Time of the stage pictures, seconds from the first frame. If no output needs more, only the
        frames from 2 s before it are processed.
    lanes
        If given, the lane is found too.
    ground
        If given, the speeds of the vehicles are measured.
    overwrite
        Replace outputs that are there already.
    threads
        Number of threads that search; None for one per core.
    codec_threads
        Number of threads of the encoder; None for one per core.
    timeout
        Seconds in which the next frame must be read or written. After that the job fails, so that
        a disk or a network that hangs does not stop a batch. Reading gets the duration of the part
        before `start` in addition.
    begin
        When the video begins: see `find_clock`.
    interval
        That of tables of counts, seconds; None for the whole.
    """

    source: Path
    outputs: tuple[Output, ...] = ()
    start: Fraction | None = None
    end: Fraction | None = None
    frames: int | None = None
    at: Fraction = Fraction(0)
    lanes: "LaneRequest | None" = None
    overwrite: bool = False
    threads: int | None = None
    codec_threads: int | None = None
    timeout: float = IO_TIMEOUT
    begin: str | None = None
    interval: int | None = None
    ground: "GroundRequest | None" = None

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
    """

    width: int
    height: int
    frames: int
    tracks: int
    seconds: float
    clock: Clock | None = None


@dataclass(frozen=True, slots=True)
class OpenVideo:
    """A video that is being read, and the results of its frames."""

    reader: VideoReader
    pipeline: Pipeline
    results: Generator[FrameResult]


def check_job(job: VideoJob) -> None:
    """Refuse a job whose outputs cannot be written, before any work. Raises `OutputError`."""
    record_input(job.source)
    check_sinks(job.outputs, overwrite=job.overwrite)


@contextmanager
def open_video(
    job: VideoJob,
    model: DetectorModel,
    settings: Settings,
    *,
    tracker: VideoTracker | None = None,
    steps: Sequence[Step] = (),
) -> Iterator[OpenVideo]:
    """Open a video, and follow the vehicles through it; parameters and errors as in `run_video`.

    Reading and searching run in threads.
    """
    timeout = job.timeout + float(job.start or 0)
    reading = _reader_and_frames(job, settings)
    try:
        with named_errors(job.source, VideoError), prefetch(reading, timeout=timeout) as read:
            reader: VideoReader = next(read)
            latest = max(job.start or Fraction(0), job.at if job.shows_at else Fraction(0))
            if reader.length is not None and latest >= reader.length:
                raise _no_frame(job, f"{float(latest):.2f} s is beyond its end", reader.length)
            images, frames = peek(read)
            make = partial(build, lanes=job.lanes, ground=job.ground)
            try:
                pipeline = make(model, settings, reader.info, images, tracker=tracker, steps=steps)
            except FrameSizeError as error:
                log.warning("%s: gets no boxes: %s", job.source, error)
                pipeline = make(as_model(lambda _: NO_BOXES), settings, reader.info, images)
            del images  # otherwise they stay in memory for the whole run
            threads = job.threads or core_count()
            with closing(pipeline.follow(frames, job.source, threads=threads)) as results:
                yield OpenVideo(reader, pipeline, results)
    except StalledError as error:
        raise VideoError(
            f"{job.source}: nothing was read or written for {timeout:g} s; check the disk"
        ) from error


def _reader_and_frames(job: VideoJob, settings: Settings) -> Generator[Any]:
    """Yield the reader, and then its frames; the thread that reads them opens and closes it."""
    with VideoReader(
        job.source, start=job.start, end=job.end, frames=job.frames, settings=settings.input
    ) as reader:
        yield reader
        yield from reader


@recorded_inputs()
def run_video(
    job: VideoJob,
    model: DetectorModel,
    settings: Settings,
    *,
    tracker: VideoTracker | None = None,
    steps: Sequence[Step] = (),
    progress: Progress = no_progress,
) -> RunTotals:
    """Run a job. Its outputs appear under their names together, at the end of the run.

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
    only_at = job.shows_at and all(sink_kind(each.sink).one_frame for each in job.outputs)
    if only_at and job.frames is None:
        job = replace(job, start=max(job.at - LEAD, job.start or Fraction(0)))
    with (
        OutputFiles(overwrite=job.overwrite) as files,
        open_video(job, model, settings, tracker=tracker, steps=steps) as video,
        open_sinks(job.outputs, context := _context(job, settings, files, video)) as sinks,
    ):
        info = video.reader.info
        advance = progress(None if only_at else video.reader.expected)
        frames, writing, last, ids = 0, 0.0, None, set[int]()
        counter: VehicleCounter | None = None
        for result in video.results:
            written = time.perf_counter()
            for sink in sinks:
                sink.write(result)
            writing += time.perf_counter() - written
            ids.update(track.id for track in result.tracks)
            frames += 1
            counter = result.counter
            advance(1)
            if result.searched:
                last = result.frame.time - info.start
                if only_at and last >= job.at:
                    break
        if last is None or (job.shows_at and last < job.at):
            when = "in the times given" if last is None else f"at {float(job.at):.2f} s or later"
            raise _no_frame(job, f"no frame is read {when}", video.reader.length)
        for warning in counter.counts().warnings if counter else ():
            log.warning("%s: %s", job.source, warning)
    seconds = time.perf_counter() - began
    log.info(
        "%s: finding the vehicles took %.1f s, drawing and writing them %.1f s",
        *(job.source, seconds - writing, writing),
    )
    return RunTotals(info.width, info.height, frames, len(ids), seconds, context.clock)


def _context(
    job: VideoJob, settings: Settings, files: OutputFiles, video: OpenVideo
) -> SinkContext:
    info = video.reader.info
    return SinkContext(
        files,
        settings,
        info,
        is_part=job.is_part,
        at=job.at,
        codec_threads=job.codec_threads or core_count(),
        interval=job.interval,
        clock=find_clock(job.source, job.begin, info.tags.creation_time, float(info.start)),
        timeout=job.timeout,
        outputs=job.outputs,
        stage_pictures=stage_pictures_of(video.pipeline.detector),
    )


def _no_frame(job: VideoJob, words: str, length: Fraction | None) -> VideoError:
    """Return the error of a time at which there is no frame."""
    end = "check them" if length is None else f"it ends at {float(length):.2f} s"
    return VideoError(f"{job.source}: {words}; {end}")
