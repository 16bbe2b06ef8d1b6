"""The stream: frames → search → heat → tracker → annotation → writer."""

import logging
import os
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from vdet.config.schema import OutputSettings, Settings
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.search import lay_grids
from vdet.detect.svm.stages import check_stages
from vdet.errors import ConfigError, ImageError, VideoError
from vdet.files import check_output
from vdet.lanes.road import LaneRequest, RoadFinder
from vdet.media import Frame, FrameWriter, NullWriter, VideoInfo, VideoReader, VideoWriter
from vdet.pipeline.annotation import StagePictures, annotate
from vdet.pipeline.following import follow, pass_on
from vdet.pipeline.result import FrameResult
from vdet.pipeline.sinks.tracks import check_suffix, track_writer
from vdet.pipeline.threads import Stalled, ahead, aside, behind, quiet_libraries

log = logging.getLogger("vdet")

PATIENCE = 120.0  # seconds


@dataclass(frozen=True, slots=True)
class VideoJob:
    """A video to be searched, which part of it, and where its results go (None: nowhere).

    `start` and `end` are seconds from the first frame; frames with start ≤ time < end are taken,
    at most `frames` of them. With `stages`, pictures of every stage are made of the first of them
    at or after the second `at`. With `lanes`, the lane is found too, and all is drawn on the
    undistorted frames.
    """

    source: Path
    video: Path | None = None
    tracks: Path | None = None
    start: Fraction | None = None
    end: Fraction | None = None
    frames: int | None = None
    stages: Path | None = None
    at: Fraction = Fraction(0)
    lanes: LaneRequest | None = None

    @property
    def outputs(self) -> tuple[Path, ...]:
        """The files that are made: the video, the tracks, or both."""
        return tuple(path for path in (self.video, self.tracks) if path is not None)


@dataclass(frozen=True, slots=True)
class Summary:
    """What a run did: upright frames of which size, shown tracks (ids), seconds of wall time."""

    width: int
    height: int
    frames: int
    tracks: int
    seconds: float


def check_job(job: VideoJob, *, overwrite: bool) -> None:
    """Refuse, before any work, a job whose outputs could not be written. Raises `OutputError`."""
    for path in job.outputs:
        check_output(path, overwrite=overwrite, inputs=[job.source])
    if job.tracks is not None:
        check_suffix(job.tracks)
    if job.stages is not None:
        check_stages(job.stages, overwrite=overwrite)


def process_video(
    job: VideoJob,
    model: LinearModel,
    settings: Settings,
    *,
    threads: int | None = None,
    codec_threads: int | None = None,
    patience: float = PATIENCE,
    progress: Callable[[int | None], Callable[[int], object]] = lambda _: lambda _: None,
) -> Summary:
    """Run a job; its outputs appear under their names when all is done.

    Reading, searching, and encoding overlap in threads; tracking and drawing lie between them.

    Parameters
    ----------
    threads
        Of the search; None for one a core.
    codec_threads
        Of the decoder, and of the encoder; None lets them choose.
    patience
        Seconds in which the next frame must be read or written, else the job is given up: a disk
        or a network that hangs must not stop a batch. What lies before `job.start` has as long
        again as it lasts.
    progress
        Called once with the expected number of frames (None: unknown); what it returns is called
        with the number of frames done since the last call.

    Raises
    ------
    VideoError, OutputError
        The video cannot be read, too much of it is damaged, or the camera of `job.lanes` took
        frames of another shape; an output cannot be written. No output is left then.
    """
    began = time.perf_counter()
    ids: set[int] = set()
    frames = 0
    patience += float(job.start or 0)
    with ExitStack() as stack:
        stack.enter_context(_naming_what_hangs(job, patience))
        stack.enter_context(quiet_libraries())
        reader = aside(lambda: _open(job, settings, codec_threads), patience=patience)
        read = stack.enter_context(ahead(_frames(reader), patience=patience))
        watch = _road_watch(job.lanes, settings, reader.info)
        tracks = stack.enter_context(track_writer(job.tracks))
        video = _video_writer(job, reader.info, settings.output, codec_threads)
        encode = stack.enter_context(behind(video.write, within=video, patience=patience))
        at = reader.info.start + job.at
        pictures = StagePictures(job.stages, at, model.features)
        advance = progress(reader.expected)
        size = reader.info.width, reader.info.height
        threads = threads or os.cpu_count() or 1
        if lay_grids(settings, model.features, *size):
            results = follow(read, model, settings, *size, threads=threads, watch=watch)
        else:
            log.warning(
                "%s: no search window fits into its frames of %d×%d pixels; it gets no boxes",
                job.source,
                *size,
            )
            results = pass_on(read, settings, *size, watch)
        for result in stack.enter_context(closing(_named(results, job.source))):
            pictures.offer(result)
            tracks.write(result.frame, result.tracks, result.road)
            encode(annotate(result))
            ids.update(track.id for track in result.tracks)
            frames += 1
            advance(1)
        if not frames:
            raise VideoError(f"{job.source}: no frame lies in the times given; check them")
        if pictures.missing:
            log.warning("%s: no frame at or after --at; no stage pictures", job.source)
    return Summary(*size, frames, len(ids), time.perf_counter() - began)


def _open(job: VideoJob, settings: Settings, threads: int | None) -> VideoReader:
    return VideoReader(
        job.source,
        start=job.start,
        end=job.end,
        frames=job.frames,
        threads=threads,
        settings=settings.input,
    )


def _frames(reader: VideoReader) -> Generator[Frame]:
    """Give all frames, and close the reader in the thread that took them."""
    with reader:
        yield from reader


@contextmanager
def _naming_what_hangs(job: VideoJob, patience: float) -> Iterator[None]:
    try:
        yield
    except Stalled as error:
        raise VideoError(
            f"{job.source}: nothing could be read or written for {patience:g} s; given up; look at "
            "the disk or network"
        ) from error


def _video_writer(
    job: VideoJob, info: VideoInfo, output: OutputSettings, threads: int | None
) -> FrameWriter:
    if job.video is None:
        return NullWriter()
    part = (job.start, job.end, job.frames) != (None, None, None)
    return VideoWriter(job.video, info, output, whole_sound=not part, threads=threads)


def _road_watch(
    lanes: LaneRequest | None, settings: Settings, info: VideoInfo
) -> RoadFinder | None:
    try:
        return RoadFinder(lanes, settings.lanes, info.width, info.height) if lanes else None
    except ConfigError as error:
        raise VideoError(f"{info.path}: {error}") from error


def _named(results: Iterator[FrameResult], source: Path) -> Generator[FrameResult]:
    """Put the video's name before an error of the search."""
    try:
        yield from results
    except ImageError as error:
        raise VideoError(f"{source}: {error}") from error
