"""A run: a video is read, searched and followed, and the results go to sinks."""

import logging
import time
from collections.abc import Generator, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from pathlib import Path

from vdet.boxes import NO_BOXES
from vdet.config.schema import Settings
from vdet.detect.factory import as_model
from vdet.detect.protocol import DetectorModel, stage_pictures_of
from vdet.errors import FrameSizeError, VideoError
from vdet.files import OutputFiles
from vdet.lanes.road import LaneRequest
from vdet.media import Frame, VideoReader
from vdet.progress import Progress, no_progress
from vdet.run.loop import Pipeline, build, named_errors, peek
from vdet.run.result import FrameResult
from vdet.run.sinks.protocol import Output, SinkContext, check_sinks, open_sinks, sink_kind
from vdet.run.steps import Step
from vdet.run.threads import StalledError, prefetch, run_in_thread
from vdet.track.track import VideoTracker
from vdet.workers import core_count

log = logging.getLogger("vdet")

LEAD = Fraction(2)
"""Seconds before a moment that are searched for it: what detector and tracker remember."""

IO_TIMEOUT = 120.0  # seconds


@dataclass(frozen=True, slots=True)
class VideoJob:
    """A video, the part of it that is searched, and the outputs.

    Attributes
    ----------
    start, end
        Seconds from the first frame; frames with start ≤ time < end are searched.
    frames
        Largest number of frames to search.
    at
        Time of the stage pictures, seconds from the first frame. If no output needs more, only the
        frames from 2 s before it are searched.
    lanes
        If it is given, the lane is found too, and everything is drawn on undistorted frames.
    inputs
        Other files that are read, such as settings; outputs never replace them.
    overwrite
        Outputs that are there already are replaced.
    threads
        Number of threads that search; None for one per core.
    codec_threads
        Number of threads of the encoder; None for one per core.
    timeout
        Seconds in which the next frame must be read or written; after that the job fails, so that
        a disk or a network that hangs does not stop a batch. The duration of the part before
        `start` is added to it.
    """

    source: Path
    outputs: tuple[Output, ...] = ()
    start: Fraction | None = None
    end: Fraction | None = None
    frames: int | None = None
    at: Fraction = Fraction(0)
    lanes: LaneRequest | None = None
    inputs: tuple[Path, ...] = ()
    overwrite: bool = False
    threads: int | None = None
    codec_threads: int | None = None
    timeout: float = IO_TIMEOUT

    @property
    def is_part(self) -> bool:
        """Whether only a part of the video is searched."""
        return (self.start, self.end, self.frames) != (None, None, None)

    @property
    def shows_at(self) -> bool:
        """Whether an output shows the frame at `at`."""
        return any(sink_kind(output.sink).one_frame for output in self.outputs)

    @property
    def needs_only_at(self) -> bool:
        """Whether no output needs another frame."""
        return self.shows_at and all(sink_kind(each.sink).one_frame for each in self.outputs)


@dataclass(frozen=True, slots=True)
class RunTotals:
    """What a run did.

    Attributes
    ----------
    width, height
        Size of the upright frames, pixels.
    frames, tracks
        Number of frames searched, and of tracks shown (ids).
    seconds
        Wall time.
    """

    width: int
    height: int
    frames: int
    tracks: int
    seconds: float


@dataclass(frozen=True, slots=True)
class OpenVideo:
    """A video that is read, and the results of its frames."""

    reader: VideoReader
    pipeline: Pipeline
    results: Generator[FrameResult]


def check_job(job: VideoJob) -> None:
    """Refuse a job whose outputs cannot be written, before any work. Raises `OutputError`."""
    check_sinks(job.outputs, overwrite=job.overwrite, inputs=[job.source, *job.inputs])


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

    open_reader = partial(
        VideoReader,
        job.source,
        start=job.start,
        end=job.end,
        frames=job.frames,
        settings=settings.input,
    )
    with ExitStack() as stack:
        stack.enter_context(named_errors(job.source, VideoError))
        stack.enter_context(_no_stall(job.source, timeout))
        reader = run_in_thread(open_reader, timeout=timeout)
        read = stack.enter_context(prefetch(_frames(reader), timeout=timeout))
        _check_times(job, reader.length)
        images, frames = peek(read)
        make = partial(build, settings=settings, video=reader.info, images=images, lanes=job.lanes)
        try:
            pipeline = make(model, tracker=tracker, steps=steps)
        except FrameSizeError as error:
            log.warning("%s: gets no boxes: %s", job.source, error)
            pipeline = make(as_model(lambda _: NO_BOXES))
        del make, images  # else they stay in memory for the whole run
        results = pipeline.follow(frames, job.source, threads=job.threads or core_count())
        yield OpenVideo(reader, pipeline, stack.enter_context(closing(results)))


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

    Reading, searching and encoding run in threads; tracking and drawing in the calling one.

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
    only_at = job.needs_only_at
    job = _without_early_frames(job)
    with (
        OutputFiles(overwrite=job.overwrite) as files,
        open_video(job, model, settings, tracker=tracker, steps=steps) as video,
        open_sinks(job.outputs, _context(job, settings, files, video)) as sinks,
    ):
        info = video.reader.info
        advance = progress(None if only_at else video.reader.expected)
        frames, writing, last, ids = 0, 0.0, None, set[int]()
        for result in video.results:
            written = time.perf_counter()
            for sink in sinks:
                sink.write(result)
            writing += time.perf_counter() - written
            ids.update(track.id for track in result.tracks)
            frames += 1
            advance(1)
            if result.searched:
                last = result.frame.time - info.start
                if only_at and last >= job.at:
                    break
        _check_seen(job, last, video.reader.length)
    seconds = time.perf_counter() - began
    log.info(
        "%s: finding the vehicles took %.1f s, drawing and writing them %.1f s",
        *(job.source, seconds - writing, writing),
    )
    return RunTotals(info.width, info.height, frames, len(ids), seconds)


def _without_early_frames(job: VideoJob) -> VideoJob:
    """Return a job that reads only the frames that are needed for the moment `at`."""
    if not job.needs_only_at or job.frames is not None:
        return job
    return replace(job, start=max(job.at - LEAD, job.start or Fraction(0)))


def _context(
    job: VideoJob, settings: Settings, files: OutputFiles, video: OpenVideo
) -> SinkContext:
    return SinkContext(
        files,
        settings,
        video.reader.info,
        is_part=job.is_part,
        at=job.at,
        codec_threads=job.codec_threads or core_count(),
        timeout=job.timeout,
        outputs=job.outputs,
        stage_pictures=stage_pictures_of(video.pipeline.detector),
    )


def _check_times(job: VideoJob, length: Fraction | None) -> None:
    """Refuse times that lie beyond the end, where the file declares its length."""
    latest = max(job.start or Fraction(0), job.at if job.shows_at else Fraction(0))
    if length is not None and latest >= length:
        raise VideoError(f"{job.source}: {float(latest):.2f} s is beyond its end{_at_end(length)}")


def _check_seen(job: VideoJob, last: Fraction | None, length: Fraction | None) -> None:
    """Refuse times at which there was no frame; `last` is the time of the last frame read."""
    if last is None:
        missing = "lies in the times given"
    elif job.shows_at and last < job.at:
        missing = f"is read at {float(job.at):.2f} s or later"
    else:
        return
    raise VideoError(f"{job.source}: no frame {missing}{_at_end(length)}")


def _at_end(length: Fraction | None) -> str:
    return "; check them" if length is None else f"; it ends at {float(length):.2f} s"


def _frames(reader: VideoReader) -> Generator[Frame]:
    """Yield all frames; the thread that reads them closes the reader."""
    with reader:
        yield from reader


@contextmanager
def _no_stall(source: Path, timeout: float) -> Iterator[None]:
    try:
        yield
    except StalledError as error:
        raise VideoError(
            f"{source}: nothing could be read or written for {timeout:g} s; check the disk or "
            "the network"
        ) from error
