"""The Python API: vehicles in NumPy arrays, in images and in videos.

Images are BGR uint8 arrays `(H, W, 3)`, as OpenCV reads them.

The default detector is the network. A model file determines the detector: .npz the linear model,
.onnx a network. Settings can choose a detector too, for example `load_settings("svm")`.

You can pass your own detector or tracker as an object:

* a detector is a function that takes an image and returns `Boxes`, or a `VideoDetector`, or a
  `DetectorModel`, which makes a detector for each video;
* a tracker is a `VideoTracker`, for one video.

A name is that of a kind of detector or tracker, from vdet or another package, or of a model file.
"""

import math
import os
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import chain
from os import PathLike
from pathlib import Path
from typing import TypedDict, Unpack

import numpy as np

from vdet.boxes import Box, Boxes, Image
from vdet.config.kinds import DetectorKind, TrackerKind, kind_of_model
from vdet.config.loading import find_config
from vdet.config.loading import load_settings as load_layers
from vdet.config.schema import DetectorSettings, Settings, TrackerSettings
from vdet.detect.detectors import DetectorObject, as_model, load_detector
from vdet.errors import ArgumentError, ArgumentTypeError, ImageError, VdetError
from vdet.evaluate.results import score_files
from vdet.evaluate.scores import Scores
from vdet.files import OutputFiles, valid_text
from vdet.labels.label import Format, SavedTracks, SourceVideo
from vdet.media import Picture
from vdet.media.images import read_image
from vdet.review.corrections import Corrections, apply_corrections
from vdet.run.images import ImageJob, ImageSearch, input_files, run_images
from vdet.run.loop import Parts
from vdet.run.sinks import Output
from vdet.run.sinks.protocol import BaseSink, BatchTotal, SinkKind, check_sinks
from vdet.run.steps import FrameResult, Step
from vdet.run.video import Results, Run, RunTotals, run_video
from vdet.track.track import FrameTracks, Track, VideoTracker, make_tracker
from vdet.traffic.counting import count_files, count_frames
from vdet.traffic.counts import Counts
from vdet.traffic.records import VehicleRecord
from vdet.workers import no_progress, reporting

__all__ = (
    "BaseSink", "BatchTotal", "Box", "Boxes", "Counts", "Detector", "DetectorKind",
    "DetectorSettings", "Format", "FrameResult", "FrameTracks", "Results", "Run",
    "RunTotals", "SavedTracks", "Scores", "Settings", "SinkKind", "Track", "Tracker",
    "TrackerKind", "TrackerSettings", "VdetError", "VehicleRecord", "count", "detect_image",
    "detect_video", "evaluate_tracks", "follow", "load_settings", "vehicles",
)  # fmt: skip

PathName = str | PathLike[str]
Paths = PathName | Sequence[PathName]
AnyDetector = PathName | DetectorObject
AnyTracker = str | VideoTracker
Seconds = float | Fraction


def load_settings(config: Paths = (), assignments: Sequence[str] = ()) -> Settings:
    """Read settings.

    Parameters
    ----------
    config
        A YAML file, or the name of a shipped config such as "seed", or several; later ones win.
    assignments
        Single values that override the files, as `--set` takes them: `["tracker.kind=rules"]`.

    Raises
    ------
    ConfigError
        A file or a value is wrong; the message has one line for each mistake.
    """
    return load_layers(
        [find_config(os.fspath(path_name)) for path_name in _listed(config)], assignments
    )


class Detector:
    """Finds vehicles in single images; `follow` and the others also accept it as a detector.

    Parameters
    ----------
    detector
        A model file, a name such as "svm", or an object; None: as set.

    Raises
    ------
    ConfigError, ModelError
        The detector is unknown, or its model file cannot be used.
    """

    def __init__(
        self, settings: Settings | None = None, *, detector: AnyDetector | None = None
    ) -> None:
        self._settings, parts = _choose(settings, detector)
        self._model = parts.model
        self.for_video = self._model.for_video

    def detect(self, image: Image | PathName) -> Boxes:
        """Find the vehicles in an image: the path of a file, or an array, BGR uint8 `(H, W, 3)`.

        Each image is searched on its own; `follow` also uses the other frames of a video.
        Raises `ImageError` if it cannot be read or is too small to search, `ArgumentTypeError` or
        `ArgumentError` (a `TypeError` or `ValueError`) if it is neither a path nor such an array.
        """
        source = Path("image")
        if isinstance(image, str | PathLike):
            source = Path(image)
            image = read_image(source)
        expected = "must be a path or an array, BGR uint8 (H, W, 3)"
        if not isinstance(image, np.ndarray):
            raise ArgumentTypeError(f"image: {expected}, not a {type(image).__name__}")
        if image.dtype != "uint8" or image.ndim != 3 or image.shape[2] != 3 or not image.size:
            raise ArgumentError(f"image: {expected}, not {image.dtype} {image.shape}")
        return ImageSearch(self._model, self._settings).detect(source, image).detections


class Tracker:
    """Follows vehicles through the frames of one video; make a new one for every video.

    Parameters
    ----------
    width, height
        Size of the frames, pixels.
    """

    def __init__(self, width: int, height: int, settings: Settings | None = None) -> None:
        self._tracker = make_tracker(settings or Settings(), width, height)
        self._time = -math.inf

    def update(
        self, detections: Boxes, time: float, image: Image | Picture | None = None
    ) -> list[Track]:
        """Track the vehicles into the next frame, and return those to show, by id.

        Parameters
        ----------
        detections
            The vehicles that any detector found in the frame.
        time
            Presentation time of the frame, seconds; must increase from frame to frame.
        image
            The frame; only the tracker `rules` needs it.

        Raises `ArgumentError`, a `ValueError`, if the time is not a finite number or does not
        increase.
        """
        self.observe(detections, time, image)
        return self.at(time)

    def observe(self, detections: Boxes, time: float, image: Image | Picture | None = None) -> None:
        """Track the vehicles into the next frame; arguments and errors as for `update`."""
        if not self._time < time < math.inf:
            raise ArgumentError(f"time: {time} s; must be after the previous frame, {self._time} s")
        picture = Picture(image) if isinstance(image, np.ndarray) else image
        self._tracker.observe(detections, time, picture)
        self._time = time

    def at(self, time: float) -> list[Track]:
        """Return the vehicles at another time, for a frame that was not searched.

        Times must not decrease from call to call. A time may be up to `tracker.look_ahead` seconds
        before the latest frame; the result then also uses the later detections.
        """
        return self._tracker.at(time)


class RunOptions(TypedDict, total=False):
    """How a video is processed: keywords of `follow`, `vehicles` and `detect_video`.

    Attributes
    ----------
    settings
        None: the defaults. A `Run` in place of the video has its own, and its own part.
    detector, tracker
        Objects or names, see the module docstring; None: as set. A detector object searches every
        frame, unless the settings say which. Several threads search frames at once.
    steps
        Each receives every result, and returns it, changed or unchanged.
    start, end
        Seconds from the first frame; frames with start ≤ time < end are processed.
    frames
        Maximum number of frames to process.
    """

    settings: Settings | None
    detector: AnyDetector | None
    tracker: AnyTracker | None
    steps: Sequence[Step]
    start: Seconds | None
    end: Seconds | None
    frames: int | None


def follow(source: PathName | Run, **options: Unpack[RunOptions]) -> Results:
    """Return an iterator over the frames of a video, each with its detections and tracks.

    `source` is the video, or a `Run`; the `options` are those of `RunOptions`: `settings`,
    `detector`, `tracker`, `steps`, `start`, `end` and `frames`.

    Raises `VideoError` with the first frame if the video cannot be read or searched.
    """
    return Results(*_prepare(source, options))


def vehicles(source: PathName | Run, **options: Unpack[RunOptions]) -> tuple[VehicleRecord, ...]:
    """Return a record of each vehicle of a video, by id: its times, class and path.

    Parameters and errors as for `follow`.
    """
    results = follow(source, **options)
    deque(results, maxlen=0)
    return results.vehicles


def detect_video(
    source: PathName | Run,
    video: PathName | None = None,
    *,
    tracks: Paths = (),
    outputs: Mapping[str, Paths] | None = None,
    overwrite: bool = False,
    progress: Callable[[int, int | None], object] | None = None,
    **options: Unpack[RunOptions],
) -> RunTotals:
    """Find and follow the vehicles in a video, and write the requested outputs.

    All outputs appear together when the run succeeds; otherwise none appears.

    Parameters
    ----------
    source
        The video, or a `Run` to choose a number of threads, too.
    video
        Output: the video with a box around each vehicle, .mp4, .mov or .mkv.
    tracks
        Output: the boxes of every frame, one file or several: .txt (MOTChallenge), .csv, .jsonl
        or .coco.json.
    outputs
        Other outputs by the name of their sink, one path or several.
    overwrite
        Replace existing outputs.
    progress
        Called after each frame with the number of frames done, and the total, None if unknown.

    Options as for `follow`; errors as for the command `vdet detect-video`.
    """
    run, parts = _prepare(source, options)
    requested = _outputs({"video": video or (), "tracks": tracks, **(outputs or {})})
    run = replace(run, outputs=run.outputs + requested, overwrite=overwrite or run.overwrite)
    return run_video(run, parts, progress=reporting(progress) if progress else no_progress)


def detect_image(
    source: PathName,
    image: PathName | None = None,
    *,
    outputs: Mapping[str, Paths] | None = None,
    settings: Settings | None = None,
    detector: AnyDetector | None = None,
    overwrite: bool = False,
) -> Boxes:
    """Find the vehicles in an image file, and write the requested outputs.

    `image` is the output, with a box around each vehicle; other parameters as for `detect_video`.
    """
    settings, parts = _choose(settings, detector)
    job = ImageJob(Path(source), _outputs({"image": image or (), **(outputs or {})}))
    inputs = input_files(job.source, settings=settings)
    files = OutputFiles(overwrite=overwrite, inputs=inputs)
    check_sinks(job.outputs, files)
    (result,) = run_images([job], (), ImageSearch(parts.model, settings), files)
    if isinstance(result, ImageError):
        raise result
    return result.detections


def count(
    tracks: PathName | Iterable[FrameTracks | FrameResult],
    settings: Settings,
    *,
    size: tuple[int, int] | None = None,
    rate: float | None = None,
    corrections: Paths = (),
) -> Counts:
    """Count the vehicles of a video at the lines and in the zones of the settings.

    Parameters
    ----------
    tracks
        A file written by `detect_video`, the results of `follow`, or their `frame_tracks`.
    size
        Width and height of the frames, pixels; None: from the tracks or `camera.size`.
    rate
        Frames per second, for a file of tracks without times.
    corrections
        A file of corrections that a reviewer saved, or several, which are merged.
    """
    reviews = [Corrections.read(Path(path)) for path in _listed(corrections)]
    key, with_all = "", bool(reviews)
    if isinstance(tracks, str | PathLike):
        key = str(Path(tracks))
        counted = count_files([Path(tracks)], settings, size, rate, with_all_classes=with_all)
    else:
        frames = iter(tracks)
        first = next(frames, None)
        if isinstance(first, FrameResult):
            size = size or (first.frame.picture.width, first.frame.picture.height)
        items = frames if first is None else chain([first], frames)
        shown = (item.frame_tracks if isinstance(item, FrameResult) else item for item in items)
        counts = count_frames(shown, settings, size, with_all_classes=with_all)
        if isinstance(first, FrameResult) and size:
            source = SourceVideo(valid_text(first.source.as_posix()), *size)
            counts = replace(counts, source=source)
        counted = {key: counts}
    return apply_corrections(counted, reviews, settings)[key]


def evaluate_tracks(tracks: PathName, truth: PathName, *, until: int | None = None) -> Scores:
    """Compare a file of tracks with the ground truth.

    Parameters
    ----------
    tracks, truth
        Files in any format that `vdet eval tracks` reads.
    until
        Number of the last frame to compare, from 1; None: the last one of the ground truth.

    Raises `TruthError` if a file cannot be used.
    """
    return score_files(Path(tracks), Path(truth), until).scores


def _prepare(source: PathName | Run, options: RunOptions) -> tuple[Run, Parts]:
    """Return the run and its parts; a `Run` has its own settings and part of the video."""
    if unknown := options.keys() - RunOptions.__annotations__.keys():
        known = ", ".join(RunOptions.__annotations__)
        raise ArgumentTypeError(f"{min(unknown)}: unknown option; known: {known}")
    if isinstance(source, Run):
        for name in ("settings", "start", "end", "frames"):
            if options.get(name) is not None:
                raise ArgumentError(f"{name}: a Run has its own; remove it")
        run = source
    else:
        start, end = _exact(options.get("start")), _exact(options.get("end"))
        run = Run(Path(source), start=start, end=end, frames=options.get("frames"))
    settings = source.settings if isinstance(source, Run) else options.get("settings")
    effective, parts = _choose(settings, options.get("detector"), options.get("tracker"))
    return replace(run, settings=effective), replace(parts, steps=options.get("steps", ()))


def _choose(
    settings: Settings | None, detector: AnyDetector | None, tracker: AnyTracker | None = None
) -> tuple[Settings, Parts]:
    """Choose detector and tracker by name, by object, or as set; names change the settings."""
    effective = settings or Settings()
    if isinstance(tracker, str):
        section = load_layers(assignments=[f"tracker.kind={tracker}"]).tracker
        effective, tracker = effective.model_copy(update={"tracker": section}), None
    if detector is not None and not isinstance(detector, str | PathLike):
        rates = {"searches_per_second", "stride"} - effective.detector.model_fields_set
        own = {"kind": "object", "model": None, **dict.fromkeys(rates)}
        own_section = effective.detector.model_copy(update=own)
        effective = effective.model_copy(update={"detector": own_section})
        return effective, Parts(as_model(detector), tracker)
    if detector is not None:
        effective = _with_detector(effective, os.fspath(detector))
    return effective, Parts(load_detector(effective.detector), tracker)


def _with_detector(settings: Settings, name: str) -> Settings:
    """Return settings for a kind of detector, or for a model file, which decides the kind."""
    kind = kind_of_model(Path(name))
    if kind != settings.detector.kind:
        explicit = {key: getattr(settings, key) for key in settings.model_fields_set - {"detector"}}
        settings = load_layers(detector=kind or name).model_copy(update=explicit)
    if kind is None:
        return settings
    section = settings.detector.model_copy(update={"model": name})
    return settings.model_copy(update={"detector": section})


def _outputs(named: Mapping[str, Paths]) -> tuple[Output, ...]:
    return tuple(
        Output(sink, Path(path)) for sink, paths in named.items() for path in _listed(paths)
    )


def _listed(paths: Paths) -> Sequence[PathName]:
    return [paths] if isinstance(paths, str | PathLike) else paths


def _exact(seconds: Seconds | None) -> Fraction | None:
    if seconds is not None and not 0 <= seconds < math.inf:
        raise ArgumentError(f"start and end: must be seconds from 0, not {seconds}")
    return None if seconds is None else Fraction(str(seconds))  # 0.04 means 1/25
