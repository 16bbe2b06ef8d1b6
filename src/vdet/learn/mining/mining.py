"""From a labelled video, frame by frame, to a zip file of patches."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vdet.config.schema import Settings, SvmSettings
from vdet.detect.factory import load_detector
from vdet.detect.protocol import DetectorModel
from vdet.detect.svm.detector import SvmDetector, horizon_of
from vdet.detect.svm.features import to_patch
from vdet.detect.svm.pyramid import FramePyramid
from vdet.detect.svm.search import lay_grids
from vdet.detect.svm.windows import Windows
from vdet.errors import DataError, ImageError, TruthError, VideoError
from vdet.evaluate.labelled_video import LabelledVideo
from vdet.evaluate.truth import read_truth
from vdet.learn.dataset import PatchArchive, patch_archive
from vdet.learn.mining.choosing import Choice, Kind, choose, scored_windows
from vdet.learn.mining.placing import cut_sides
from vdet.media import Frame, VideoInfo, VideoReader
from vdet.media.images import Image
from vdet.pipeline.loop import peek

PATCH = 64
"""Side of the patches, pixels, as in the Udacity set."""

_FOLDERS: dict[Kind, str] = {
    "vehicle": "vehicles/mined_{}",
    "box": "boxes/mined_{}",
    "false alarm": "non-vehicles/mined_{}",
    "part": "non-vehicles/mined_{}_parts",
}


@dataclass(frozen=True, slots=True)
class MiningJob:
    """The video to mine, its truth, and the zip file to write.

    The frames `first` to `last` are used, counted from 1: one in `every`, and all that cut a
    vehicle off. If `last` is None, the last frame is that of the truth.
    """

    video: Path
    truth: Path
    output: Path
    every: int = 4
    first: int = 1
    last: int | None = None


@dataclass(frozen=True, slots=True)
class Mined:
    """Number of frames searched, and of patches of each kind."""

    frames: int
    vehicles: int
    boxes: int
    false_alarms: int
    parts: int


def mine(
    job: MiningJob,
    settings: Settings,
    model: Path | None = None,
    *,
    progress: Callable[[int | None], Callable[[int], object]] = lambda _: lambda _: None,
) -> Mined:
    """Search the labelled frames and write patches for the training.

    Patches of `video.mp4` lie in the groups `mined_video` of `vehicles/`, `boxes/` and
    `non-vehicles/`, those of parts in `non-vehicles/mined_video_parts/`; frame and window are in
    their names.

    Parameters
    ----------
    model
        Model file of the detector whose false alarms are searched for; None for the shipped one.
    progress
        Called with the number of frames to read; what it returns is called with the number of
        frames read since the last call.

    Raises
    ------
    TruthError
        The truth cannot be used, or has nothing about these frames.
    VideoError
        The video cannot be read or searched.
    DataError
        There is nothing to learn from these frames.
    OutputError
        The zip file cannot be written.
    """
    detector = load_detector(settings.detector, model)
    truth = read_truth(job.truth)
    last = min(job.last or truth.last_frame, truth.last_frame)
    if last < job.first:
        raise TruthError(
            f"{job.truth}: covers the frames up to {truth.last_frame}; mine some of these"
        )
    searched, number = 0, 0
    counts: Counter[Kind] = Counter()
    with VideoReader(job.video, frames=last) as reader, patch_archive(job.output) as archive:
        advance = progress(last)
        images, frames = peek(reader)
        windows_of = _search(job, detector, reader.info, images)
        for frame in frames:
            number = frame.index + 1
            labelled = truth.frame(number)
            regular = (number - job.first) % job.every == 0
            wanted = regular or _cuts_off_a_vehicle(labelled, reader.info.width)
            if wanted and number >= job.first:
                searched += 1
                choices = _choices(windows_of(frame.image), labelled, frame, settings)
                _add(archive, frame, choices, job.video.stem)
                counts.update(choice.kind for choice in choices)
            advance(1)
        if number < last:
            read_truth(job.truth, frame_count=number)  # raises an error with the line
        if not counts:
            raise DataError(
                f"{job.video}: no window fits a vehicle or is a false alarm; try others"
            )
    return Mined(searched, counts["vehicle"], counts["box"], counts["false alarm"], counts["part"])


def _search(
    job: MiningJob,
    model: DetectorModel,
    info: VideoInfo,
    images: Sequence[Image],
) -> Callable[[Image], Windows]:
    """Return a function that returns the windows of a frame with their probabilities.

    Those of the linear model are its own. For another detector they are laid as the linear model's
    settings say, and a window has the score of the detection that it fits.
    """
    size = info.width, info.height
    try:
        detector = model.for_video(*size, images)
        if isinstance(detector, SvmDetector):
            return lambda image: detector.search(image, None).windows
        svm = SvmSettings()
        horizon = horizon_of(svm, images)
        grids = lay_grids(svm, svm.features, *size, horizon=horizon)
    except ImageError as error:
        raise VideoError(f"{job.video}: {error}") from error
    boxes = np.concatenate([grid.boxes for grid in grids])

    def search(image: Image) -> Windows:
        detections = detector.detect(detector.search(image, None))
        return scored_windows(boxes, detections, info.width)

    return search


def _cuts_off_a_vehicle(truth: LabelledVideo, width: int) -> bool:
    """Return whether a side of the frame cuts a vehicle off, which is rare and hard to learn."""
    return any(cut_sides(box, width).any() for box in truth.boxes[~truth.ignored])


def _choices(
    windows: Windows, truth: LabelledVideo, frame: Frame, settings: Settings
) -> list[Choice]:
    """Choose at random, with a seed that depends on the frame alone."""
    rng = np.random.default_rng((settings.training.seed, frame.index))
    return list(choose(windows, truth, frame.image.shape[1], settings.mining, rng))


def _add(archive: PatchArchive, frame: Frame, choices: Sequence[Choice], stem: str) -> None:
    width = frame.image.shape[1]
    beyond = max((max(-each.box.x, each.box.right - width) for each in choices), default=0)
    pixels = FramePyramid(frame.image, margin=max(0, beyond))
    for choice in choices:
        box = choice.box
        place = f"frame{frame.index + 1:06}_x{box.x:04}_y{box.y:04}_s{box.width:04}"
        patch = to_patch(pixels.crop(box.x, box.y, box.width, box.height), PATCH)
        archive.add(f"{_FOLDERS[choice.kind].format(stem)}/{place}.png", patch, choice.sides)
