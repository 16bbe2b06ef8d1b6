"""Runs of the pipeline that find red cars, and results as they give them."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from red_cars import CAR, HEIGHT, SETTINGS, WIDTH, red_finder, road
from vdet.boxes import NO_BOXES, Box, Boxes, Image
from vdet.config.schema import Settings
from vdet.detect.detectors import StageImages
from vdet.detect.svm.detector import SvmModel
from vdet.files import OutputFiles
from vdet.findings import Findings
from vdet.lanes.road import Road
from vdet.media import Frame, Picture, VideoInfo
from vdet.media.reader import VideoReader
from vdet.run.loop import Parts, build, peek
from vdet.run.sinks import Output
from vdet.run.sinks.protocol import SinkContext, open_sinks
from vdet.run.steps import FINDINGS, FrameResult
from vdet.run.video import Run, RunTotals, run_video
from vdet.track.track import Track
from vdet.traffic.clock import Clock
from vdet.traffic.counter import LiveTraffic
from vdet.workers import Progress, no_progress

COUNT = 60
"""Frames of the fixture `red_clip`."""


def video_info(width: int = WIDTH, height: int = HEIGHT) -> VideoInfo:
    """Describe a video of `COUNT` frames, 25 a second."""
    rate = Fraction(25)
    return VideoInfo(Path("red.mp4"), width, height, rate, 1 / rate, frames=COUNT)


VIDEO = video_info()


def model_for(settings: Settings) -> SvmModel:
    """Return the detector of red cars under these settings."""
    return SvmModel(red_finder(), settings.svm)


def outputs(**paths: Path) -> tuple[Output, ...]:
    """Return outputs by the names of their sinks: `video=…`, `tracks=…`."""
    return tuple(Output(sink, path) for sink, path in paths.items())


def run_red(
    job: Run, settings: Settings = SETTINGS, *, progress: Progress = no_progress, **own: Any
) -> RunTotals:
    """Run a job that finds red cars, with a tracker or steps of its own."""
    parts = Parts(model_for(settings), **own)
    return run_video(replace(job, settings=settings), parts, progress=progress)


def follow(
    frames: Iterable[Frame], settings: Settings = SETTINGS, *, threads: int = 1
) -> Iterator[FrameResult]:
    """Find and follow red cars through some frames."""
    images, frames = peek(frames)
    pipeline = build(Parts(model_for(settings)), settings, VIDEO, images)
    return pipeline.follow(frames, VIDEO.path, threads=threads)


def result_of(
    *vehicles: Box | Track,
    image: Image | None = None,
    found: Road | None = None,
    source: Path = Path("red.mp4"),
    index: int = 0,
    time: Fraction = Fraction(0),
) -> FrameResult:
    """Return a result with these tracks; a box becomes a track of its number, from 1.

    `found` is the road; without an `image` the red car is in the frame.
    """
    frame = Frame(index, time, Picture(road(CAR) if image is None else image))
    tracks = tuple(
        Track(number, vehicle, 0.9, state="detected") if isinstance(vehicle, Box) else vehicle
        for number, vehicle in enumerate(vehicles, start=1)
    )
    return FrameResult(source, frame, NO_BOXES, tracks, {"lane": found} if found else {})


def stages_of_trace(image: Image, detections: Boxes) -> dict[str, Image]:
    """Return the stage pictures of the detector of red cars, where it made the detections."""
    if detections.trace is None:
        return {}
    height, width = image.shape[:2]
    detector = model_for(SETTINGS).for_video(width, height, [image])
    return detector.stage_images(image, detections)


def write(
    output: Output,
    results: Iterable[FrameResult],
    *,
    settings: Settings = SETTINGS,
    video: VideoInfo | None = VIDEO,
    at: Fraction = Fraction(0),
    stage_images: StageImages = stages_of_trace,
    clock: Clock | None = None,
    findings: Findings | None = None,
) -> None:
    """Give results to a sink of its own run.

    Without a `video` they are those of pictures. `at` is the moment that is asked for.
    """
    with OutputFiles(overwrite=True) as files:
        traffic = LiveTraffic(settings, video.width, video.height, clock) if video else None
        context = SinkContext(
            files, settings, video, at=at, traffic=traffic, stage_images=stage_images
        )
        context.facts[FINDINGS] = findings or Findings()
        with open_sinks([output], context) as sinks:
            for result in results:
                if traffic:
                    traffic.add(result.frame_tracks)
                sinks.write(result)
            if traffic:
                traffic.end(findings or Findings())


def read(path: Path) -> list[Frame]:
    """Read all frames of a video."""
    with VideoReader(path) as reader:
        return list(reader)
