"""The stream: frames → search → heat → tracker → annotation → writer."""

import itertools
import logging
import os
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from vdet.annotation import StagePictures, annotate
from vdet.config.schema import OutputSettings, Settings
from vdet.detection import Detector, horizon_of
from vdet.errors import ConfigError, ImageError, VideoError
from vdet.files import check_output
from vdet.frame_result import FrameResult
from vdet.lanes.road import LaneRequest, Look, RoadWatch
from vdet.model import LinearModel
from vdet.overlay.stages import check_stages
from vdet.stream import ahead, behind, each_with, quiet_libraries
from vdet.trackfile import check_suffix, track_writer
from vdet.tracking.choice import tracker_of
from vdet.video import Frame, FrameWriter, NullWriter, VideoInfo, VideoReader, VideoWriter
from vdet.windows import Windows

HORIZON_FRAMES = 5
"""From the first one on, in which the horizon is looked for."""

log = logging.getLogger("vdet")


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


@dataclass(frozen=True, slots=True)
class Summary:
    """What a run did: frames, shown tracks (ids), seconds of wall time."""

    frames: int
    tracks: int
    seconds: float


def check_job(job: VideoJob, *, overwrite: bool) -> None:
    """Refuse, before any work, a job whose outputs could not be written. Raises `OutputError`."""
    for path in (job.video, job.tracks):
        if path is not None:
            check_output(path, overwrite=overwrite, inputs=[job.source])
    if job.tracks is not None:
        check_suffix(job.tracks)
    if job.stages is not None:
        check_stages(job.stages, overwrite=overwrite)


def follow(
    frames: Iterable[Frame],
    model: LinearModel,
    settings: Settings,
    width: int,
    height: int,
    *,
    threads: int = 1,
    watch: RoadWatch | None = None,
) -> Iterator[FrameResult]:
    """Find and follow the cars through frames of one size, in order; and the lane, with `watch`.

    The search of several frames may run in `threads` at once; what follows it, frame by frame,
    gives the same result whatever their number.

    Raises
    ------
    ImageError
        No search window fits into such a frame.
    """
    frames, horizon = seek_horizon(frames, settings)
    detector = Detector(model, settings, width, height, horizon=horizon)
    track = tracker_of(settings, width, height)

    def search(frame: Frame) -> tuple[Windows, Look | None]:
        windows = detector.search(frame.image, frame.index)
        return windows, watch.look(frame.image) if watch else None

    with each_with(search, frames, threads) as searched:
        for frame, (windows, look) in searched:
            detection = detector.accumulate(windows)
            tracks = track(frame.image, detection.regions)
            road = watch.follow(look) if watch and look else None
            yield FrameResult(frame, detection, tuple(tracks), road)


def seek_horizon(frames: Iterable[Frame], settings: Settings) -> tuple[Iterable[Frame], float]:
    """Return the same frames, and the horizon's row as a share of their height."""
    rest = iter(frames)
    first = list(itertools.islice(rest, HORIZON_FRAMES))
    horizon = horizon_of(settings, [frame.image for frame in first])
    log.info("the horizon lies at %.2f of the height", horizon)
    return itertools.chain(first, rest), horizon


def process_video(
    job: VideoJob,
    model: LinearModel,
    settings: Settings,
    *,
    threads: int | None = None,
    progress: Callable[[int | None], Callable[[int], object]] = lambda _: lambda _: None,
) -> Summary:
    """Run a job; its outputs appear under their names when all is done.

    Reading, searching, and encoding overlap in threads; tracking and drawing lie between them.

    Parameters
    ----------
    threads
        Of the search; None for one a core.
    progress
        Called once with the expected number of frames (None: unknown); what it returns is called
        with the number of frames done since the last call.

    Raises
    ------
    VideoError, OutputError
        The video cannot be read or searched, or the camera of `job.lanes` took frames of another
        shape; an output cannot be written. No output is left then.
    """
    began = time.perf_counter()
    ids: set[int] = set()
    frames = 0
    with ExitStack() as stack:
        stack.enter_context(quiet_libraries())
        reader = stack.enter_context(
            VideoReader(job.source, start=job.start, end=job.end, frames=job.frames)
        )
        watch = _road_watch(job.lanes, settings, reader.info)
        tracks = stack.enter_context(track_writer(job.tracks))
        video = stack.enter_context(_video_writer(job, reader, settings.output))
        encode = stack.enter_context(behind(video.write))
        read = stack.enter_context(ahead(reader))
        at = reader.info.start + job.at
        pictures = StagePictures(job.stages, at, model.features)
        advance = progress(reader.expected)
        size = reader.info.width, reader.info.height
        threads = threads or os.cpu_count() or 1
        results = follow(read, model, settings, *size, threads=threads, watch=watch)
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
    return Summary(frames, len(ids), time.perf_counter() - began)


def _video_writer(job: VideoJob, reader: VideoReader, output: OutputSettings) -> FrameWriter:
    if job.video is None:
        return NullWriter()
    part = (job.start, job.end, job.frames) != (None, None, None)
    return VideoWriter(job.video, reader.info, output, whole_sound=not part)


def _road_watch(lanes: LaneRequest | None, settings: Settings, info: VideoInfo) -> RoadWatch | None:
    try:
        return RoadWatch(lanes, settings.lanes, info.width, info.height) if lanes else None
    except ConfigError as error:
        raise VideoError(f"{info.path}: {error}") from error


def _named(results: Iterator[FrameResult], source: Path) -> Generator[FrameResult]:
    """Put the video's name before an error of the search."""
    try:
        yield from results
    except ImageError as error:
        raise VideoError(f"{source}: {error}") from error
