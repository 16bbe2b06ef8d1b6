"""What Python users call: vehicles in NumPy frames, in pictures and in videos.

Images are BGR uint8 arrays `(H, W, 3)`, as OpenCV reads them.

The detector is the network where none is chosen. A model file decides which detector runs: the
linear model with .npz, a network with .onnx. Settings choose a detector too, for example
`load_settings("svm")`; without `model`, the shipped file that fits them is used.

A detector or a tracker of your own is an object, which is used as it is:

* a detector is a function that takes an image and returns `Boxes`, or a `VideoDetector`, or a
  `DetectorModel`, which makes a detector for each video;
* a tracker is a `VideoTracker`, for one video.

A name is that of a kind of detector or tracker, also of another package.
"""

import math
import os
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from os import PathLike
from pathlib import Path

from vdet.boxes import Box, Boxes, Image
from vdet.config.loading import find_config, kind_of_model
from vdet.config.loading import load_settings as load_layers
from vdet.config.schema import DetectorSettings, Settings, TrackerSettings
from vdet.detect.factory import DetectorKind, DetectorObject, as_model, load_detector
from vdet.detect.protocol import DetectorModel, VideoDetector
from vdet.errors import VdetError, check_positive
from vdet.evaluate.scores import Scores
from vdet.evaluate.video import score_files
from vdet.files import record_input, recorded_inputs
from vdet.lanes.camera import load_camera
from vdet.lanes.ground import GroundRequest, load_ground
from vdet.lanes.road import LaneRequest
from vdet.media import Frame, Picture
from vdet.progress import no_progress, reporting
from vdet.regions import check_mask
from vdet.run.pictures import PictureJob, PictureSearch, run_picture
from vdet.run.result import FrameResult
from vdet.run.sinks.protocol import Output, SinkContext, SinkKind, check_sinks
from vdet.run.steps import Step, StepContext
from vdet.run.video import RunTotals, VideoJob, check_job, open_video, run_video
from vdet.track.factory import TrackerKind, make_tracker
from vdet.track.track import FrameTracks, Track, VideoTracker
from vdet.traffic.counting import count_files, count_frames
from vdet.traffic.counts import Counts, Event

__all__ = (
    "Box", "Boxes", "Counts", "Detector", "DetectorKind", "DetectorModel", "DetectorSettings",
    "Event", "Frame", "FrameResult", "FrameTracks", "Picture", "RunTotals", "Scores", "Settings",
    "SinkContext", "SinkKind", "Step", "StepContext", "Track", "Tracker", "TrackerKind",
    "TrackerSettings", "VdetError", "VideoDetector", "VideoTracker", "count_tracks", "detect_image",
    "detect_video", "evaluate_tracks", "follow", "load_settings",
)  # fmt: skip

PathName = str | PathLike[str]
Paths = PathName | Sequence[PathName]
AnyDetector = str | DetectorObject
AnyTracker = str | VideoTracker
Seconds = float | Fraction


def load_settings(config: PathName | None = None, assignments: Sequence[str] = ()) -> Settings:
    """Read settings.

    Parameters
    ----------
    config
        A YAML file, or the name of a shipped config such as "seed"; None for the default settings.
    assignments
        Single values on top, as the command line takes them: `["tracker.kind=rules"]`.

    Raises
    ------
    ConfigError
        The file or a value is wrong; the message has one line for each mistake.
    """
    path = None if config is None else find_config(os.fspath(config))
    return load_layers(path, assignments)


class Detector:
    """Finds vehicles in single pictures; `follow` and the others take it as their detector too.

    Raises
    ------
    ConfigError, ModelError
        The detector is unknown, or its model file cannot be used.
    """

    def __init__(
        self,
        settings: Settings | None = None,
        model: PathName | None = None,
        *,
        detector: AnyDetector | None = None,
    ) -> None:
        self._settings, self._model, _ = _resolved(settings, model, detector, None)
        self.for_video = self._model.for_video

    def detect(self, image: Image) -> Boxes:
        """Find the vehicles in a picture, BGR uint8 `(H, W, 3)`.

        Each picture is searched for itself; `follow` uses what consecutive frames have in common.

        Raises `ImageError` if it is too small to be searched, `ValueError` if it is no such array.
        """
        if image.dtype != "uint8" or image.ndim != 3 or image.shape[2] != 3:
            raise ValueError(f"image: {image.dtype} {image.shape}; give BGR uint8 (H, W, 3)")
        return PictureSearch(self._model, self._settings).detect(Path("image"), image).detections


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
        """Follow the vehicles into the next frame, and return those that are shown, by id.

        Parameters
        ----------
        detections
            The vehicles that any detector sees in the frame.
        time
            When the frame is shown, seconds; it increases from frame to frame.
        image
            The frame; only the tracker `rules` needs it.

        Raises `ValueError` if the time is not a finite number or does not increase.
        """
        self.observe(detections, time, image)
        return self.at(time)

    def observe(self, detections: Boxes, time: float, image: Image | Picture | None = None) -> None:
        """Follow the vehicles into the next frame; arguments and errors as of `update`."""
        if not self._time < time < math.inf:
            raise ValueError(f"time: {time} s is not after the {self._time} s of the frame before")
        self._tracker.observe(detections, time, _picture(image))
        self._time = time

    def at(self, time: float) -> list[Track]:
        """Return the vehicles at another time, for a frame in which no detector looked for them.

        Times may not decrease from call to call. At a time before the latest frame, at most
        `tracker.look_ahead` seconds before it, what came later is known.
        """
        return self._tracker.at(time)


def follow(
    source: PathName,
    *,
    detector: AnyDetector | None = None,
    tracker: AnyTracker | None = None,
    steps: Sequence[Step] = (),
    settings: Settings | None = None,
    model: PathName | None = None,
    start: Seconds | None = None,
    end: Seconds | None = None,
    frames: int | None = None,
    lanes: bool = False,
    camera: PathName | None = None,
    threads: int = 1,
) -> Generator[FrameResult]:
    """Yield a result for each frame of a video: the frame, its detections and its tracks.

    Parameters
    ----------
    detector, tracker
        Objects or names, as the module describes them; None for those of the settings. With an
        object, and without settings, every frame is searched.
    steps
        Each gets every result, and returns it or a changed one.
    start, end
        Seconds from the first frame; frames with start ≤ time < end are taken.
    frames
        Largest number of frames to take.
    lanes, camera
        Whether the lane is found too, and the file of the camera that `vdet calibrate` wrote.
    threads
        Threads of the search; the results do not depend on it.

    Raises `VideoError` if the video cannot be read or searched.
    """
    check_positive(frames=frames, threads=threads)
    settings, loaded, tracker = _resolved(settings, model, detector, tracker)
    part = _exact(start), _exact(end), frames
    job = VideoJob(Path(source), (), *part, lanes=_lanes(lanes, camera), threads=threads)
    with open_video(job, loaded, settings, tracker=tracker, steps=steps) as video:
        yield from video.results


@recorded_inputs()
def detect_video(
    source: PathName,
    video: PathName | None = None,
    *,
    tracks: Paths | None = None,
    outputs: Mapping[str, Paths] | None = None,
    detector: AnyDetector | None = None,
    tracker: AnyTracker | None = None,
    steps: Sequence[Step] = (),
    settings: Settings | None = None,
    model: PathName | None = None,
    start: Seconds | None = None,
    end: Seconds | None = None,
    frames: int | None = None,
    at: Seconds = 0,
    lanes: bool = False,
    camera: PathName | None = None,
    ground: PathName | None = None,
    begin: str | None = None,
    interval: int | None = None,
    threads: int | None = None,
    overwrite: bool = False,
    progress: Callable[[int, int | None], object] | None = None,
) -> RunTotals:
    """Find and follow the vehicles in a video, and write the outputs that are asked for.

    All outputs appear together when the run ends well, and none appears otherwise.

    Parameters
    ----------
    video
        The video with the vehicles drawn in: .mp4, .mov or .mkv.
    tracks
        Every shown box, in one file or several: .txt (MOTChallenge), .csv, .jsonl, .coco.json, .xml
        (CVAT), .kitti.txt, .yolo.zip or .ottrk.
    outputs
        Other outputs, one path or several, by the name of their sink.
    at
        The moment of the output "stages", seconds from the first frame.
    ground
        The file of the ground, for the speeds of vehicles.
    begin, interval
        When the video begins (as `--begin`), and the seconds of intervals of counts and flows.
    overwrite
        Replace outputs that are there already.
    progress
        Called after each frame with the number of frames done, and that of all if it is known.

    The others are those of `follow`, and the errors those of the command `vdet detect-video`.
    """
    check_positive(frames=frames, threads=threads)
    settings, loaded, tracker = _resolved(settings, model, detector, tracker)
    wanted = _outputs({"video": video, "tracks": tracks, **(outputs or {})})
    part = _exact(start), _exact(end), frames, Fraction(str(at))
    check_mask(settings.regions)
    job = VideoJob(Path(source), wanted, *part, _lanes(lanes, camera), overwrite, threads)
    job = replace(job, begin=begin, interval=interval, ground=_ground(ground))
    check_job(job)
    reported = reporting(progress) if progress else no_progress
    return run_video(job, loaded, settings, tracker=tracker, steps=steps, progress=reported)


@recorded_inputs()
def detect_image(
    source: PathName,
    picture: PathName | None = None,
    *,
    outputs: Mapping[str, Paths] | None = None,
    detector: AnyDetector | None = None,
    settings: Settings | None = None,
    model: PathName | None = None,
    overwrite: bool = False,
) -> Boxes:
    """Find the vehicles in a picture file, and write the outputs that are asked for.

    `picture` is the file with the vehicles drawn in; the others are those of `detect_video`.
    """
    settings, loaded, _ = _resolved(settings, model, detector, None)
    job = PictureJob(Path(source), _outputs({"picture": picture, **(outputs or {})}))
    check_mask(settings.regions)
    record_input(job.source)
    check_sinks(job.outputs, overwrite=overwrite)
    return run_picture(job, PictureSearch(loaded, settings), overwrite=overwrite).detections


def count_tracks(
    tracks: PathName | Iterable[FrameTracks],
    lines: PathName | None = None,
    *,
    size: tuple[int, int] | None = None,
    rate: float | None = None,
    settings: Settings | None = None,
    ground: PathName | None = None,
) -> Counts:
    """Count the vehicles of a video at lines and in zones, from its tracks.

    `follow` counts too, where its settings have lines or zones: `FrameResult.counter`.

    Parameters
    ----------
    tracks
        A file that `detect_video` wrote, or the tracks of each frame: `FrameResult.frame_tracks`.
    lines
        The file of lines and zones; None for those of the settings.
    size
        Width and height of the frames, pixels; None: as the tracks or the lines say.
    rate
        Frames per second, for a file of tracks without times.
    ground
        The file of the ground, for the speeds at events.
    """
    counts = (settings or Settings()).counts
    if lines is not None:
        counts = load_layers(places={"counts": Path(lines)}).counts
    if isinstance(tracks, str | PathLike):
        files = count_files([Path(tracks)], counts, size, rate, ground=_ground(ground))
        return files[str(Path(tracks))]
    return count_frames(tracks, counts, size, _ground(ground))


def evaluate_tracks(
    tracks: PathName, truth: PathName, *, until: int | None = None, rate: float | None = None
) -> Scores:
    """Compare a file of tracks with the truth.

    Parameters
    ----------
    until
        Number of the last frame to use, from 1; None: the last that the truth covers.
    rate
        Frames per second of the video, where the files do not say it.

    Raises `TruthError` if a file cannot be used.
    """
    return score_files(Path(tracks), Path(truth), until=until, rate=rate).total


def _resolved(
    settings: Settings | None,
    model: PathName | None,
    detector: AnyDetector | None,
    tracker: AnyTracker | None,
) -> tuple[Settings, DetectorModel, VideoTracker | None]:
    """Return the settings, the detector, and the tracker; None for that of the settings."""
    path = None if model is None else Path(model)
    changes: dict[str, object] = {}
    if isinstance(tracker, str):
        changes["tracker"] = load_layers(assignments=[f"tracker.kind={tracker}"]).tracker
        tracker = None
    if detector is None or isinstance(detector, str):
        if detector or settings is None:
            kind = detector or (kind_of_model(path) if path else None)
            changes["detector"] = load_layers(detector=kind).detector
        chosen = (settings or Settings()).model_copy(update=changes)
        return chosen, load_detector(chosen.detector, path), tracker
    if path is not None:
        raise ValueError("model: the detector is an object, which has its own; leave model out")
    if settings is None:
        changes["detector"] = DetectorSettings(kind="object")  # every frame is searched
    return (settings or Settings()).model_copy(update=changes), as_model(detector), tracker


def _outputs(named: Mapping[str, Paths | None]) -> tuple[Output, ...]:
    return tuple(
        Output(sink, Path(path))
        for sink, paths in named.items()
        if paths is not None
        for path in ([paths] if isinstance(paths, str | PathLike) else paths)
    )


def _lanes(lanes: bool, camera: PathName | None) -> LaneRequest | None:
    if camera is not None:
        return LaneRequest(load_camera(Path(camera)))
    return LaneRequest() if lanes else None


def _ground(file: PathName | None) -> GroundRequest | None:
    return None if file is None else load_ground(Path(file))


def _exact(seconds: Seconds | None) -> Fraction | None:
    return None if seconds is None else Fraction(str(seconds))  # 0.04 means 1/25


def _picture(image: Image | Picture | None) -> Picture | None:
    return image if image is None or isinstance(image, Picture) else Picture(image)
