"""The stream: frames → search → heat → tracker → overlay → writer."""

import os
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from vdet.config.scaling import scale_lengths
from vdet.config.schema import FeatureSettings, OutputSettings, Settings
from vdet.detection import Detection, Detector
from vdet.errors import ImageError, OutputError, VideoError
from vdet.files import check_output
from vdet.model import LinearModel
from vdet.overlay.drawing import draw_tracks, track_label
from vdet.overlay.stages import write_stages
from vdet.stream import ahead, behind, each_with, quiet_libraries
from vdet.trackfile import check_suffix, track_writer
from vdet.tracking.cars import Cars
from vdet.tracking.track import Track
from vdet.video import Frame, FrameWriter, NullWriter, VideoInfo, VideoReader, VideoWriter


@dataclass(frozen=True, slots=True)
class VideoJob:
    """A video to be searched, which part of it, and where its results go (None: nowhere).

    `start` and `end` are seconds from the first frame; frames with start ≤ time < end are taken,
    at most `frames` of them. With `stages`, pictures of every stage are made of the first of them
    at or after the second `at`.
    """

    source: Path
    video: Path | None = None
    tracks: Path | None = None
    start: Fraction | None = None
    end: Fraction | None = None
    frames: int | None = None
    stages: Path | None = None
    at: Fraction = Fraction(0)


@dataclass(frozen=True, slots=True)
class FrameResult:
    """A frame, what was found in it, and the cars that are shown."""

    frame: Frame
    detection: Detection
    tracks: tuple[Track, ...]


@dataclass(frozen=True, slots=True)
class Summary:
    """What a run did: frames, shown tracks (ids), seconds of wall time."""

    frames: int
    tracks: int
    seconds: float


def check_job(job: VideoJob, *, overwrite: bool) -> None:
    """Refuse, before any work, a job whose outputs could not be written. Raises `OutputError`."""
    for path in (job.video, job.tracks):
        if path is not None and path.resolve() == job.source.resolve():
            raise OutputError(f"{path}: is the input itself; give another output")
        if path is not None:
            check_output(path, overwrite=overwrite)
    if job.tracks is not None:
        check_suffix(job.tracks)


def follow(
    frames: Iterable[Frame],
    model: LinearModel,
    settings: Settings,
    width: int,
    height: int,
    *,
    threads: int = 1,
) -> Iterator[FrameResult]:
    """Find and follow the cars through frames of one size, in order.

    The search of several frames may run in `threads` at once; what follows it, frame by frame,
    gives the same result whatever their number.

    Raises
    ------
    ImageError
        No search window fits into such a frame.
    """
    detector = Detector(model, settings, width, height)
    cars = Cars(scale_lengths(settings.tracker, height / settings.reference_height))
    with each_with(lambda frame: detector.search(frame.image), frames, threads) as searched:
        for frame, windows in searched:
            detection = detector.accumulate(windows)
            tracks = cars.update(frame.image, detection.regions)
            yield FrameResult(frame, detection, tuple(tracks))


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
        The video cannot be read; an output cannot be written. No output is left then.
    """
    began = time.perf_counter()
    ids: set[int] = set()
    frames = 0
    with ExitStack() as stack:
        stack.enter_context(quiet_libraries())
        reader = stack.enter_context(
            VideoReader(job.source, start=job.start, end=job.end, frames=job.frames)
        )
        tracks = stack.enter_context(track_writer(job.tracks))
        video = stack.enter_context(_video_writer(job, reader, settings.output))
        encode = stack.enter_context(behind(video.write))
        read = stack.enter_context(ahead(reader))
        pictures = _StagePictures(job, reader.info.start, settings, model.features)
        advance = progress(reader.expected)
        results = _follow_all(read, reader.info, model, settings, threads or os.cpu_count() or 1)
        for result in stack.enter_context(closing(results)):
            pictures.offer(result)
            tracks.write(result.frame, result.tracks)
            draw_tracks(result.frame.image, result.tracks)
            encode(result.frame)
            ids.update(track.id for track in result.tracks)
            frames += 1
            advance(1)
    return Summary(frames, len(ids), time.perf_counter() - began)


def _video_writer(job: VideoJob, reader: VideoReader, output: OutputSettings) -> FrameWriter:
    if job.video is None:
        return NullWriter()
    part = (job.start, job.end, job.frames) != (None, None, None)
    return VideoWriter(job.video, reader.info, output, whole_sound=not part)


def _follow_all(
    frames: Iterator[Frame], info: VideoInfo, model: LinearModel, settings: Settings, threads: int
) -> Generator[FrameResult]:
    try:
        yield from follow(frames, model, settings, info.width, info.height, threads=threads)
    except ImageError as error:
        raise VideoError(f"{info.path}: {error}") from error


class _StagePictures:
    """Makes the stage pictures of a job when their frame comes."""

    def __init__(
        self, job: VideoJob, start: Fraction, settings: Settings, features: FeatureSettings
    ) -> None:
        self._folder = job.stages
        self._at = start + job.at
        self._settings = settings
        self._features = features

    def offer(self, result: FrameResult) -> None:
        """Make them of this frame if it is the first at or after the time asked for."""
        if self._folder is None or result.frame.time < self._at:
            return
        write_stages(
            self._folder,
            result.frame.image,
            result.detection,
            [(track.box, track_label(track)) for track in result.tracks],
            settings=self._settings,
            features=self._features,
        )
        self._folder = None
