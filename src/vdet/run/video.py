"""A run: read a video, search its frames, track the vehicles, and pass the results to sinks.

`vdet draw` reads the scene that a camera shows, and the tracks of its vehicles.
"""

import logging
import math
import time
from collections.abc import Generator, Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from vdet.boxes import NO_BOXES, Image
from vdet.config.schema import Settings
from vdet.detect.detectors import StageImages, as_model, load_detector, stage_images_of, warnings_of
from vdet.errors import ConfigError, FrameSizeError, TruthError, VideoError
from vdet.files import FileIds, OutputFiles
from vdet.findings import Finding, Findings, at_places, warnings_in, without
from vdet.media import Frame, VideoInfo
from vdet.media.images import is_image_file, read_image
from vdet.media.reader import VideoReader
from vdet.regions import Regions
from vdet.run.images import input_files
from vdet.run.loop import Parts, build, named_errors, peek, with_later_classes
from vdet.run.sinks import Output
from vdet.run.sinks.protocol import SinkContext, check_sinks, open_sinks, sink_kind
from vdet.run.steps import FINDINGS, Fact, Facts, FrameResult, findings_in
from vdet.track.track import FrameTracks
from vdet.traffic.clock import Clock, check_intervals, find_clock
from vdet.traffic.counter import LiveTraffic, source_video
from vdet.traffic.counts import Corrected, Counts
from vdet.traffic.records import VehicleRecord
from vdet.workers import Progress, core_count, no_progress, read_async

if TYPE_CHECKING:
    from vdet.labels.label import SourceVideo
    from vdet.review.corrections import Corrections

log = logging.getLogger("vdet")

_MAX_SAMPLES = 20
"""Maximum number of frames for the image of the scene; at least half of them are used."""
_STILL_FRAMES = 5000
"""Number of frames to read for it if the tracks are saved."""


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
class SceneTracks:
    """The tracks of the vehicles in a scene, and reasons to doubt them where there are lines."""

    frames: list[FrameTracks]
    findings: tuple[Finding, ...] = ()


def saved_tracks(
    tracks: Path, run: Run, size: tuple[int, int], video: VideoInfo | None = None
) -> SceneTracks:
    """Return the frames of a file of tracks in the part of a run, with the vehicles in its regions.

    `size` is that of the frames, pixels. Without a video, the first frame of the file is the first
    one of the video. Raises `TruthError`, also if the tracks are of frames of another size.
    """
    from vdet.labels.label import may_be_same  # most runs read no tracks
    from vdet.labels.reading import read_tracks

    saved = read_tracks(tracks, float(video.rate) if video else None, size)
    if video and saved.video and not may_be_same(saved.video.name, video.name):
        log.warning("%s: is of %s, not %s", tracks, saved.video.name, video.name)
    if not saved.has_times:
        raise TruthError(f"{tracks}: has no times; CLIP must be the video")
    start, end = float(run.start or 0), math.inf if run.end is None else float(run.end)
    regions = Regions(run.settings.regions, *size)
    frames = [frame.inside(regions) for frame in saved if start <= frame.time < end]
    return SceneTracks(frames, without(at_places(saved.findings), run.settings.conditions.ignore))


class Results(Iterator[FrameResult]):
    """The results of a video, frame by frame, and their totals; a context manager.

    The video is opened when the block begins, or with the first result. Reading and searching run
    in threads. Errors as for `run_video`.

    Parameters
    ----------
    parts, tracks
        As for `run_video`.
    with_traffic
        Whether vehicles are counted and recorded.

    Attributes
    ----------
    reader, traffic, stage_images
        The open video, its counts, speeds and records so far, and what draws stages.
    corrections
        What reviewers say of the counts.
    facts
        Results of steps about the whole video, by name; empty before the last frame.
    """

    reader: VideoReader
    traffic: LiveTraffic | None = None
    corrections: "Corrections | None" = None
    stage_images: StageImages = staticmethod(lambda *_: {})

    def __init__(
        self,
        run: Run,
        parts: Parts | None = None,
        *,
        tracks: Path | None = None,
        with_traffic: bool = True,
    ) -> None:
        self._run, self._with_traffic = run, with_traffic
        self.facts: dict[str, Fact] = {}
        self._results = self._read(parts, tracks)

    def __enter__(self) -> Self:
        next(self._results)
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __next__(self) -> FrameResult:
        result = next(self._results)
        return next(self) if result is None else result

    def close(self) -> None:
        """Close the video before its last frame."""
        self._results.close()

    @property
    def counts(self) -> Counts | None:
        """The counts so far at the lines and in the zones of the settings; None without any."""
        return self.traffic.counts() if self.traffic else None

    @property
    def vehicles(self) -> tuple[VehicleRecord, ...]:
        """A record of each vehicle, by id; empty before the last frame."""
        return self.traffic.vehicles if self.traffic else ()

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Reasons to doubt the results; empty before the last frame."""
        return findings_in(self.facts).items

    def _read(self, parts: Parts | None, tracks: Path | None) -> Generator[FrameResult | None]:
        """Yield None when the video is open, and then the results."""
        run, settings = self._run, self._run.settings
        model = parts or (None if tracks else Parts(load_detector(settings.detector)))
        with named_errors(run.source, VideoError), read_async(_opened(run)) as (reader, frames):
            self.reader = reader
            if model:
                results = self._searched(model, frames)
            elif tracks:
                results = self._saved(tracks, frames)
            self.traffic = traffic = _live_traffic(run, reader.info)
            self.corrections = _corrections(run, traffic.source)
            yield None
            with closing(results):
                for result in with_later_classes(results) if settings.classes else results:
                    if self._with_traffic:
                        traffic.add(result.frame_tracks)
                    yield result.of_classes(settings.classes)
            if self._with_traffic:
                traffic.end(findings_in(self.facts))
                if self.corrections and (counted := traffic.counted):
                    from vdet.review.corrections import correct  # most runs load nothing of it

                    traffic.revise(correct({"": counted}, {"": self.corrections}, settings)[""])
                if counts := traffic.counts():
                    findings = replace(findings_in(self.facts), items=counts.findings)
                    self.facts[FINDINGS] = findings

    def _searched(self, parts: Parts, frames: Iterator[Frame]) -> Generator[FrameResult]:
        """Return the results of a search, which end with the facts."""
        run, info = self._run, self.reader.info
        images, every_frame = peek(frames)
        try:
            pipeline = build(parts, run.settings, info, images)
        except FrameSizeError as error:
            log.warning("%s: no vehicles can be detected: %s", run.source, error)
            pipeline = build(Parts(as_model(lambda _: NO_BOXES)), run.settings, info, images)
        self.stage_images = stage_images_of(pipeline.detector)

        def results() -> Generator[FrameResult]:
            threads = run.threads or core_count()
            yield from pipeline.follow(every_frame, run.source, threads=threads)
            self.facts.update(pipeline.facts())
            for warning in warnings_of(parts.model):
                log.warning("%s: %s", run.source, warning)

        return results()

    def _saved(self, tracks: Path, frames: Iterator[Frame]) -> Generator[FrameResult]:
        """Yield the results of saved tracks, and add the facts."""
        source, info = self._run.source, self.reader.info
        saved = saved_tracks(tracks, self._run, (info.width, info.height), info)
        shown = {frame.index: frame.tracks for frame in saved.frames}
        for frame in frames:
            of_frame = shown.get(frame.index, ())
            yield FrameResult(source, frame, NO_BOXES, of_frame, searched=False)
        self.facts[FINDINGS] = Findings(saved.findings)


def _live_traffic(run: Run, info: VideoInfo) -> LiveTraffic:
    """Return what counts in the frames of a run."""
    clock = find_clock(run.source, run.settings, tags=info.tags, length=info.duration)
    source = source_video(info, clock) if run.settings.traffic else None
    return LiveTraffic(
        run.settings,
        info.width,
        info.height,
        clock,
        source=source,
        with_all_classes=bool(run.corrections),
    )


def _corrections(run: Run, source: "SourceVideo | None") -> "Corrections | None":
    """Return the corrections of a run, merged. Raises `ConfigError` if they do not fit."""
    if not run.corrections:
        return None
    from vdet.review.corrections import Corrections, by_video  # most runs load nothing of it

    reviews = map(Corrections.read, run.corrections)
    return by_video(reviews, {"": source}, run.settings.traffic)[""]


@contextmanager
def _opened(run: Run) -> Iterator[VideoReader]:
    """Open the video when the block begins: in the thread that reads it."""
    with VideoReader(
        run.source, start=run.start, end=run.end, frames=run.frames, settings=run.settings.input
    ) as reader:
        yield reader


def run_video(
    run: Run,
    parts: Parts | None = None,
    *,
    tracks: Path | None = None,
    progress: Progress = no_progress,
    is_last: bool = False,
) -> RunTotals:
    """Process a run. Its outputs appear together, at the end of the run.

    Reading, searching and encoding run in threads, tracking and drawing in the calling thread.

    Parameters
    ----------
    parts
        The detector, the tracker and further steps; None: as the settings say.
    tracks
        File of the tracks of its vehicles, which are not searched then.
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
        return write_outputs(run, files, parts, tracks=tracks, progress=progress)


def write_outputs(
    run: Run,
    files: OutputFiles,
    parts: Parts | None,
    *,
    tracks: Path | None = None,
    progress: Progress = no_progress,
) -> RunTotals:
    """Do as `run_video`, but leave the complete outputs in `files`, under temporary names.

    Other parameters and errors as for `run_video`.
    """
    start_time = time.perf_counter()
    kinds = [sink_kind(output.sink) for output in run.outputs]
    with_traffic = bool(run.settings.traffic) or any(kind.uses_traffic for kind in kinds)
    with (
        named_errors(run.source, VideoError),
        Results(run, parts, tracks=tracks, with_traffic=with_traffic) as results,
    ):
        info, traffic, frames, ids = results.reader.info, results.traffic, 0, set[int]()
        assert traffic  # the video is open
        if with_traffic and not run.is_part:
            seconds = float(info.duration or 0)
            check_intervals(run.settings.traffic.seconds, [(0.0, seconds)])
        context = SinkContext(
            files,
            run.settings,
            info,
            is_part=run.is_part,
            start=run.start,
            end=run.end,
            at=run.at,
            outputs=run.outputs,
            traffic=traffic,
            corrections=results.corrections,
            facts=results.facts,
            stage_images=results.stage_images,
        )
        with open_sinks(run.outputs, context) as sinks:
            advance = progress("", results.reader.expected)
            for result in results:
                sinks.write(result)
                ids.update(track.id for track in result.tracks)
                frames += 1
                advance(1)
            if not frames:
                raise _no_frame(run, results.reader)
        counts = traffic.counts()
        for warning in (line for fact in results.facts.values() for line in str(fact).splitlines()):
            log.warning("%s: %s", run.source, warning)
    return RunTotals(
        width=info.width,
        height=info.height,
        frames=frames,
        tracks=len(ids),
        seconds=time.perf_counter() - start_time,
        clock=traffic.clock,
        corrected=counts.corrected if counts else None,
        facts=results.facts,
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


def read_scene(run: Run, tracks: Path | None, progress: Progress) -> tuple[Image, SceneTracks]:
    """Return the scene without vehicles, BGR uint8 `(H, W, 3)`, and the tracks of its vehicles.

    The image is the median of frames of the video, or the source if that is an image. There is a
    warning (logger "vdet") for each reason to doubt the tracks.

    Parameters
    ----------
    tracks
        A file of tracks; None: detect the vehicles in the video.

    Raises
    ------
    VdetError
        The source or the file of tracks cannot be used.
    """
    if is_image_file(run.source):
        image = read_image(run.source)
        height, width = image.shape[:2]
        shown = saved_tracks(tracks, run, (width, height)) if tracks else SceneTracks([])
    else:
        images, shown = (
            _with_saved_tracks(run, tracks, progress) if tracks else _with_detection(run, progress)
        )
        if not images:
            raise VideoError(f"{run.source}: no frames in this part; check --start and --end")
        image = np.median(images, axis=0).astype(np.uint8)
    for finding in warnings_in(shown.findings):
        log.warning("%s: %s", run.source, finding)
    return image, shown


def _with_saved_tracks(
    run: Run, tracks: Path, progress: Progress
) -> tuple[list[Image], SceneTracks]:
    """Return some of the first images, and all saved tracks."""
    with _opened(replace(run, frames=_STILL_FRAMES)) as reader:
        size = reader.info.width, reader.info.height
        saved = saved_tracks(tracks, run, size, reader.info)
        progress("reading the scene", None)
        return _spread(reader), saved


def _with_detection(run: Run, progress: Progress) -> tuple[list[Image], SceneTracks]:
    """Return some of the images, and the tracks of all frames."""
    shown: list[FrameTracks] = []
    with Results(run, with_traffic=False) as results:
        advance = progress("", results.reader.expected)

        def frames() -> Iterator[Frame]:
            for result in results:
                shown.append(result.frame_tracks)
                yield result.frame
                advance(1)

        images, findings = _spread(frames()), findings_in(results.facts)
        return images, SceneTracks(shown, at_places((*findings.items, *findings.facts)))


def _spread(frames: Iterable[Frame]) -> list[Image]:
    """Return some of the images, evenly spaced."""
    images, step = list[Image](), 1
    for number, frame in enumerate(frames):
        if number % step == 0:
            images.append(frame.image)
        if len(images) > _MAX_SAMPLES:
            images, step = images[::2], 2 * step
    return images
