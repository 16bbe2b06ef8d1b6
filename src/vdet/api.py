"""What Python users call: vehicles in NumPy frames, in pictures and in videos.

Images are BGR uint8 arrays `(H, W, 3)`, as OpenCV reads them.

The detector is the network where neither `settings` nor `model` is given. A model file decides
which detector runs: the linear model with .npz, a network with .onnx. Settings choose a detector
too, for example `load_settings("svm")`; without `model`, the shipped file that fits them is used.
"""

import os
from collections.abc import Generator, Mapping, Sequence
from fractions import Fraction
from os import PathLike
from pathlib import Path

from vdet.boxes import Box
from vdet.config.kinds import kind_of_model
from vdet.config.loading import find_config
from vdet.config.loading import load_settings as load_layers
from vdet.config.schema import DetectorSettings, Settings, TrackerSettings
from vdet.detect.detections import Detections
from vdet.detect.factory import DetectorKind, load_detector
from vdet.detect.protocol import DetectorModel, VideoDetector
from vdet.errors import VdetError
from vdet.media import Frame, Picture
from vdet.media.images import Image
from vdet.run.pictures import PictureJob, detect_picture, run_picture
from vdet.run.result import FrameResult
from vdet.run.sinks.protocol import Output, SinkContext, SinkKind, check_sinks
from vdet.run.video import RunTotals, VideoJob, check_job, open_video, run_video
from vdet.track.factory import TrackerKind, make_tracker
from vdet.track.protocol import VideoTracker
from vdet.track.track import Track

__all__ = [
    "Box",
    "Detections",
    "Detector",
    "DetectorKind",
    "DetectorModel",
    "DetectorSettings",
    "Frame",
    "FrameResult",
    "RunTotals",
    "Settings",
    "SinkContext",
    "SinkKind",
    "Track",
    "Tracker",
    "TrackerKind",
    "TrackerSettings",
    "VdetError",
    "VideoDetector",
    "VideoTracker",
    "detect_image",
    "detect_video",
    "follow",
    "load_settings",
]

PathName = str | PathLike[str]


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
    """Finds vehicles in single pictures.

    Raises
    ------
    ConfigError, ModelError
        The detector is unknown, or its model file cannot be used.
    """

    def __init__(self, settings: Settings | None = None, model: PathName | None = None) -> None:
        self._settings = _settings(settings, model)
        self._model = load_detector(self._settings.detector, _path(model))

    def detect(self, image: Image) -> Detections:
        """Find the vehicles in a picture, BGR uint8 `(H, W, 3)`.

        Each picture is searched for itself; `follow` uses what consecutive frames have in common.

        Raises
        ------
        ImageError
            The picture cannot be searched, for instance because it is too small.
        ValueError
            It is no BGR uint8 array.
        """
        if image.dtype != "uint8" or image.ndim != 3 or image.shape[2] != 3:
            raise ValueError(
                f"image: {image.dtype} of shape {image.shape}; give BGR uint8 of shape (H, W, 3)"
            )
        return detect_picture(Path("image"), image, self._model, self._settings).detections


class Tracker:
    """Follows vehicles through the frames of one video; make a new one for every video.

    Parameters
    ----------
    width, height
        Size of the frames, pixels.
    """

    def __init__(self, width: int, height: int, settings: Settings | None = None) -> None:
        self._tracker = make_tracker(settings or Settings(), width, height)

    def update(
        self, detections: Detections, time: float, image: Image | None = None
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
        """
        return self._tracker.update(detections, time, _picture(image))

    def carry(self, time: float, image: Image | None = None) -> list[Track]:
        """Follow the vehicles into a frame in which no detector looked for them.

        Nothing is missed there. The tracks are predicted. Arguments as of `update`.
        """
        return self._tracker.carry(time, _picture(image))


def follow(
    source: PathName,
    *,
    settings: Settings | None = None,
    model: PathName | None = None,
    start: float | Fraction | None = None,
    end: float | Fraction | None = None,
    frames: int | None = None,
    threads: int = 1,
) -> Generator[FrameResult]:
    """Give a result for each frame of a video: the frame, its detections and its tracks.

    Parameters
    ----------
    start, end
        Seconds from the first frame; frames with start ≤ time < end are taken.
    frames
        Most frames to take.
    threads
        Threads of the search; the results do not depend on it.

    Raises
    ------
    VideoError
        The video cannot be read or searched.
    """
    settings = _settings(settings, model)
    detector = load_detector(settings.detector, _path(model))
    job = VideoJob(Path(source), start=_exact(start), end=_exact(end), frames=frames)
    with open_video(job, detector, settings, threads=threads) as video:
        yield from video.results


def detect_video(
    source: PathName,
    video: PathName | None = None,
    *,
    tracks: PathName | None = None,
    outputs: Mapping[str, PathName] | None = None,
    settings: Settings | None = None,
    model: PathName | None = None,
    overwrite: bool = False,
    threads: int | None = None,
) -> RunTotals:
    """Find and follow the vehicles in a video, and write the outputs that are asked for.

    All outputs appear together when the run ends well, and none appears otherwise.

    Parameters
    ----------
    video
        The video with the vehicles drawn in: .mp4, .mov or .mkv.
    tracks
        Every shown box: .txt (MOTChallenge), .csv, .jsonl, .coco.json, .xml (CVAT), .kitti.txt or
        .yolo.zip.
    outputs
        Other outputs, by the name of their sink.
    threads
        Threads of the search; None for one a core.

    Raises
    ------
    VdetError
        As the command `vdet detect-video`.
    """
    settings = _settings(settings, model)
    named = {"video": video, "tracks": tracks, **(outputs or {})}
    wanted = tuple(Output(sink, Path(path)) for sink, path in named.items() if path is not None)
    job = VideoJob(Path(source), wanted, overwrite=overwrite)
    check_job(job)
    return run_video(job, load_detector(settings.detector, _path(model)), settings, threads=threads)


def detect_image(
    source: PathName,
    picture: PathName | None = None,
    *,
    outputs: Mapping[str, PathName] | None = None,
    settings: Settings | None = None,
    model: PathName | None = None,
    overwrite: bool = False,
) -> Detections:
    """Find the vehicles in a picture file, and write the outputs that are asked for.

    Parameters
    ----------
    picture
        The picture with the vehicles drawn in.
    outputs
        Other outputs, by the name of their sink.

    Raises
    ------
    VdetError
        As the command `vdet detect-image`.
    """
    settings = _settings(settings, model)
    named = {"picture": picture, **(outputs or {})}
    wanted = tuple(Output(sink, Path(path)) for sink, path in named.items() if path is not None)
    check_sinks(wanted, overwrite=overwrite, inputs=[Path(source)])
    job = PictureJob(Path(source), wanted)
    detector = load_detector(settings.detector, _path(model))
    return run_picture(job, detector, settings, overwrite=overwrite).detections


def _settings(settings: Settings | None, model: PathName | None) -> Settings:
    """Return the settings, or those of the detector that a model file is for."""
    if settings is not None:
        return settings
    return load_layers(detector=kind_of_model(Path(model)) if model else None)


def _path(path: PathName | None) -> Path | None:
    return None if path is None else Path(path)


def _exact(seconds: float | Fraction | None) -> Fraction | None:
    return None if seconds is None else Fraction(seconds)


def _picture(image: Image | None) -> Picture | None:
    return None if image is None else Picture(image)
