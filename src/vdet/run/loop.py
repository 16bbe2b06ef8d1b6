"""The loop: frames → detector → tracker → sinks."""

import itertools
import logging
import time
from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from pathlib import Path

from vdet.config.schema import Settings
from vdet.detect.detections import NO_DETECTIONS, Detections
from vdet.detect.protocol import DetectorModel, VideoDetector, limited
from vdet.errors import ConfigError, FrameSizeError, ImageError, VideoError
from vdet.files import OutputFiles
from vdet.lanes.road import FrameView, LaneRequest, RoadFinder
from vdet.media import Frame, Picture, VideoInfo, VideoReader
from vdet.media.images import Image
from vdet.progress import Progress, no_progress
from vdet.regions import lay_regions
from vdet.run.positions import with_positions
from vdet.run.result import FrameResult
from vdet.run.sinks.protocol import Output, SinkContext, check_sinks, open_sink, sink_kind
from vdet.run.stride import Search, follow_frame, search_frame
from vdet.run.threads import (
    StalledError,
    map_ordered,
    prefetch,
    run_in_thread,
    single_threaded_libraries,
)
from vdet.run.waits import Waits
from vdet.track.factory import make_tracker
from vdet.workers import core_count

log = logging.getLogger("vdet")

FIRST_FRAMES = 5
"""Number of frames that `DetectorModel.for_video` gets."""

LEAD = Fraction(2)
"""Seconds before a moment that are searched for it: detector and tracker remember so much."""

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
    overwrite
        Outputs that are there already are replaced.
    """

    source: Path
    outputs: tuple[Output, ...] = ()
    start: Fraction | None = None
    end: Fraction | None = None
    frames: int | None = None
    at: Fraction = Fraction(0)
    lanes: LaneRequest | None = None
    overwrite: bool = False

    @property
    def is_part(self) -> bool:
        """Whether only a part of the video is searched."""
        return (self.start, self.end, self.frames) != (None, None, None)


@dataclass(frozen=True, slots=True)
class Summary:
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


def check_job(job: VideoJob) -> None:
    """Refuse a job whose outputs cannot be written, before any work. Raises `OutputError`."""
    check_sinks(job.outputs, overwrite=job.overwrite, inputs=[job.source])


def run_video(
    job: VideoJob,
    model: DetectorModel,
    settings: Settings,
    *,
    threads: int | None = None,
    codec_threads: int | None = None,
    timeout: float = IO_TIMEOUT,
    progress: Progress = no_progress,
) -> Summary:
    """Run a job. Its outputs appear under their names together, at the end of the run.

    Reading, searching and encoding run in threads; tracking and drawing in the calling one.

    Parameters
    ----------
    threads
        Number of threads that search; None for one per core.
    codec_threads
        Number of threads of the decoder, and of the encoder; None for one per core.
    timeout
        Seconds in which the next frame must be read or written; after that the job fails, so that
        a disk or a network that hangs does not stop a batch. The duration of the part before
        `job.start` is added to it.
    progress
        Called once with the expected number of frames (None: unknown). What it returns is called
        with the number of frames done since the last call.

    Raises
    ------
    VideoError
        The video cannot be read, too much of it is damaged, or the camera of `job.lanes` took
        frames of another aspect ratio.
    OutputError
        An output cannot be written.

    No output is left after an error.
    """
    began, waits = time.perf_counter(), Waits()
    ids: set[int] = set()
    frames, last = 0, None
    only_at = _needs_only_at(job)
    if only_at and job.frames is None:
        job = replace(job, start=max(job.at - LEAD, job.start or Fraction(0)))
    timeout += float(job.start or 0)
    threads, codec_threads = threads or core_count(), codec_threads or core_count()
    with ExitStack() as stack:
        files = stack.enter_context(OutputFiles(overwrite=job.overwrite))
        stack.enter_context(_name_stalls(job, timeout))
        stack.enter_context(single_threaded_libraries())
        with waits.on("reading"):
            reader = run_in_thread(lambda: _open(job, settings, codec_threads), timeout=timeout)
        info = reader.info
        _check_times(job, reader.length)
        prefetched = stack.enter_context(prefetch(_frames(reader), timeout=timeout))
        read = waits.for_each("reading", prefetched)
        context = SinkContext(
            files,
            settings,
            info,
            is_part=job.is_part,
            at=job.at,
            codec_threads=codec_threads,
            timeout=timeout,
            outputs=job.outputs,
            waits=waits,
        )
        sinks = [stack.enter_context(open_sink(output, context)) for output in job.outputs]
        advance = progress(None if only_at else reader.expected)
        results = _follow_job(read, job, model, settings, video=info, threads=threads, waits=waits)
        for result in stack.enter_context(closing(results)):
            for sink in sinks:
                sink.write(result)
            ids.update(track.id for track in result.tracks)
            frames += 1
            advance(1)
            last = result.frame.time - info.start if result.searched else last
            if only_at and result.searched and last is not None and last >= job.at:
                break
        _check_seen(job, last, reader.length)
    seconds = time.perf_counter() - began
    log.info("%s: %s", job.source, waits.describe(seconds))
    return Summary(info.width, info.height, frames, len(ids), seconds)


def _needs_only_at(job: VideoJob) -> bool:
    """Return whether no output needs another frame than that at `job.at`."""
    kinds = [sink_kind(output.sink) for output in job.outputs]
    return bool(kinds) and all(kind.one_frame for kind in kinds)


def _shows_at(job: VideoJob) -> bool:
    return any(sink_kind(output.sink).one_frame for output in job.outputs)


def _check_times(job: VideoJob, length: Fraction | None) -> None:
    """Refuse times that lie beyond the end, where the file declares its length."""
    if length is None:
        return
    latest = max(job.start or Fraction(0), job.at if _shows_at(job) else Fraction(0))
    if latest >= length:
        raise VideoError(f"{job.source}: {_seconds(latest)} is beyond its end{_at_end(length)}")


def _check_seen(job: VideoJob, last: Fraction | None, length: Fraction | None) -> None:
    """Refuse times at which there was no frame; `last` is the time of the last frame read."""
    if last is None:
        raise VideoError(f"{job.source}: no frame lies in the times given{_at_end(length)}")
    if _shows_at(job) and last < job.at:
        raise VideoError(
            f"{job.source}: no frame is read at {_seconds(job.at)} or later{_at_end(length)}"
        )


def _at_end(length: Fraction | None) -> str:
    return "; check them" if length is None else f"; it ends at {_seconds(length)}"


def _seconds(time: Fraction) -> str:
    return f"{float(time):.2f} s"


def follow_frames(
    frames: Iterable[Frame],
    detector: VideoDetector,
    settings: Settings,
    video: VideoInfo,
    *,
    threads: int = 1,
    roads: RoadFinder | None = None,
    waits: Waits | None = None,
) -> Generator[FrameResult]:
    """Find and follow the vehicles through the frames of a video.

    With `roads` the lane is found too, and the distance and the lane of each vehicle.

    `threads` frames are searched at once. The results do not depend on their number. `waits` counts
    how long they are waited for.

    Raises
    ------
    ConfigError, ImageError
        The regions of the settings do not fit the frames.
    """
    regions = lay_regions(settings.regions, video.width, video.height)
    detector = limited(detector, regions)
    tracker = make_tracker(settings, video.width, video.height)
    stride = settings.detector.stride_at(video.rate)

    def search(numbered: tuple[int, Frame]) -> tuple[Search | None, FrameView | None]:
        position, frame = numbered
        view = roads.observe(frame.image) if roads else None
        return search_frame(detector, frame, position, stride), view

    waiting = partial((waits or Waits()).on, "searching")
    ahead = threads * stride  # so that each thread has a frame to search
    with map_ordered(search, enumerate(frames), threads, ahead=ahead, waiting=waiting) as results:
        for (_, frame), (found, view) in results:
            searched = found is not None
            detections, tracks = follow_frame(detector, tracker, found, frame)
            boxes = (track.box for track in tracks)
            road = roads.update(view, boxes) if roads and view else None
            if regions is not None:
                tracks = tuple(track for track in tracks if regions.contains(track.foot))
            placed = with_positions(tracks, road, settings.detector.foot)
            yield FrameResult(
                video.path, frame, detections, placed, road, detector, searched=searched
            )


def peek(frames: Iterable[Frame]) -> tuple[list[Image], Iterable[Frame]]:
    """Return the images that `DetectorModel.for_video` gets, and an iterable of all frames."""
    rest = iter(frames)
    first = list(itertools.islice(rest, FIRST_FRAMES))
    # A list iterator lets go of its list at the end; the list itself would stay for the whole run.
    return [frame.image for frame in first], itertools.chain(iter(first), rest)


class NullDetector:
    """A `VideoDetector` that finds nothing, for frames that are too small to be searched."""

    def search(self, picture: Picture, index: int | None) -> None:
        """Do nothing."""

    def detect(self, candidates: None) -> Detections:  # noqa: ARG002
        """Return no detections."""
        return NO_DETECTIONS

    def stage_pictures(self, image: Image, detections: Detections) -> dict[str, Image]:  # noqa: ARG002
        """Return no pictures."""
        return {}


def _follow_job(
    read: Iterable[Frame],
    job: VideoJob,
    model: DetectorModel,
    settings: Settings,
    *,
    video: VideoInfo,
    threads: int,
    waits: Waits,
) -> Generator[FrameResult]:
    """Follow the vehicles of a job; an error gets the name of the video."""
    size = video.width, video.height
    images, frames = peek(read)
    try:
        roads = RoadFinder(job.lanes, settings.lanes, *size) if job.lanes else None
        detector = _detector(images, job.source, model, size)
        del images  # else they stay in memory for the whole run
        yield from follow_frames(
            frames, detector, settings, video, threads=threads, roads=roads, waits=waits
        )
    except (ConfigError, ImageError) as error:
        raise VideoError(f"{job.source}: {error}") from error


def _detector(
    images: Sequence[Image], source: Path, model: DetectorModel, size: tuple[int, int]
) -> VideoDetector:
    try:
        return model.for_video(*size, images)
    except FrameSizeError as error:
        log.warning("%s: gets no boxes: %s", source, error)
        return NullDetector()


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
    """Return all frames; the thread that reads them closes the reader."""
    with reader:
        yield from reader


@contextmanager
def _name_stalls(job: VideoJob, timeout: float) -> Iterator[None]:
    try:
        yield
    except StalledError as error:
        raise VideoError(
            f"{job.source}: nothing could be read or written for {timeout:g} s; check the disk or "
            "the network"
        ) from error
