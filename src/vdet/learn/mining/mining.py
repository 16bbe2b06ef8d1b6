"""From a labelled video, frame by frame, to a zip file of patches."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vdet.config.schema import Settings, SvmSettings
from vdet.detect.detections import Detections
from vdet.detect.factory import load_detector
from vdet.detect.protocol import DetectorModel
from vdet.detect.svm.detector import SvmDetector, horizon_of
from vdet.detect.svm.features import to_patch
from vdet.detect.svm.pyramid import FramePyramid
from vdet.detect.svm.search import lay_grids
from vdet.detect.svm.windows import Windows
from vdet.errors import DataError, FrameSizeError, ImageError, TruthError, VideoError
from vdet.evaluate.labelled_video import LabelledVideo
from vdet.evaluate.truth import read_truth
from vdet.geometry import Int32Array, to_sides
from vdet.learn.dataset import PatchArchive, patch_archive
from vdet.learn.mining.choosing import (
    ChosenWindow,
    PatchKind,
    choose_windows,
    compare_windows,
    cut_sides,
)
from vdet.media import Frame, VideoInfo, VideoReader
from vdet.media.images import Image
from vdet.pipeline.loop import Progress, no_progress, peek

PATCH = 64
"""Side of the patches, pixels, as in the Udacity set."""

_FOLDERS: dict[PatchKind, str] = {
    "vehicle": "vehicles/mined_{}",
    "box": "boxes/mined_{}",
    "false alarm": "non-vehicles/mined_{}",
    "part": "non-vehicles/mined_{}_parts",
}


@dataclass(frozen=True, slots=True)
class MiningJob:
    """The video to mine, its truth, and the zip file to write.

    The frames `first` to `last` are used, counted from 1: one in `every`, and all that cut a
    vehicle off. If `last` is None, the last frame is that of the truth. `overwrite`: replace a zip
    file that is there.
    """

    video: Path
    truth: Path
    output: Path
    every: int = 4
    first: int = 1
    last: int | None = None
    overwrite: bool = False


@dataclass(frozen=True, slots=True)
class MiningResult:
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
    progress: Progress = no_progress,
) -> MiningResult:
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
    counts: Counter[PatchKind] = Counter()
    with (
        VideoReader(job.video, frames=last, settings=settings.input) as reader,
        patch_archive(job.output, overwrite=job.overwrite) as archive,
    ):
        advance = progress(last)
        images, frames = peek(reader)
        search = _window_search(job, detector, reader.info, images)
        for frame in frames:
            number = frame.index + 1
            labelled = truth.frame(number)
            regular = (number - job.first) % job.every == 0
            wanted = regular or _cuts_off_a_vehicle(labelled, reader.info.width)
            if wanted and number >= job.first:
                searched += 1
                chosen = _choose(search(frame.image), labelled, frame, settings)
                _add(archive, frame, chosen, job.video.stem)
                counts.update(window.kind for window in chosen)
            advance(1)
        if number < last:
            read_truth(job.truth, frame_count=number)  # raises an error with the line
        if not counts:
            raise DataError(
                f"{job.video}: no window fits a vehicle or is a false alarm; try others"
            )
    kinds: tuple[PatchKind, ...] = ("vehicle", "box", "false alarm", "part")
    return MiningResult(searched, *(counts[kind] for kind in kinds))


def _window_search(
    job: MiningJob, model: DetectorModel, info: VideoInfo, images: Sequence[Image]
) -> Callable[[Image], Windows]:
    """Return a function that returns the windows of a frame with their probabilities.

    Those of the linear model are its own. For another detector they are laid as the default
    settings of the linear model say, and a window has the score of the detection that it fits.
    """
    size = info.width, info.height
    try:
        detector = model.for_video(*size, images)
        if isinstance(detector, SvmDetector):
            return lambda image: detector.search(image, None).windows
        boxes = _default_windows(*size, images)
    except ImageError as error:
        raise VideoError(f"{job.video}: {error}") from error

    def search(image: Image) -> Windows:
        still = model.for_video(*size, [image])
        return score_windows(boxes, still.detect(still.search(image, None)), info.width)

    return search


def _default_windows(width: int, height: int, images: Sequence[Image]) -> Int32Array:
    """Return the windows that the linear model searches by default, int32 `(n, 4)`.

    Raises
    ------
    FrameSizeError
        No window fits into such a frame.
    """
    svm = SvmSettings()
    grids = lay_grids(svm, svm.features, width, height, horizon=horizon_of(svm, images))
    if not grids:
        raise FrameSizeError(
            f"no window fits into a frame of {width}×{height} pixels; give a larger one"
        )
    return np.concatenate([grid.boxes for grid in grids])


def score_windows(boxes: Int32Array, detections: Detections, frame_width: int) -> Windows:
    """Return windows with the highest score of the detections that each fits; 0 where none fits.

    Parameters
    ----------
    boxes
        int32 `(n, 4)`: x, y, width, height of square windows, frame pixels.
    """
    scores = np.zeros(len(boxes), np.float32)
    squares = boxes.astype(np.float64)
    found = to_sides(detections.boxes)
    for box, score in zip(found, detections.scores.tolist(), strict=True):
        fits = compare_windows(squares, box, frame_width).fits
        scores[fits] = np.maximum(scores[fits], score)
    return Windows(boxes, scores, np.ones_like(scores), boxes.astype(np.float32))


def _cuts_off_a_vehicle(truth: LabelledVideo, width: int) -> bool:
    """Return whether a side of the frame cuts a vehicle off, which is rare and hard to learn."""
    return any(cut_sides(box, width).any() for box in truth.boxes[~truth.ignored])


def _choose(
    windows: Windows, truth: LabelledVideo, frame: Frame, settings: Settings
) -> list[ChosenWindow]:
    """Choose at random, with a seed that depends on the frame alone."""
    rng = np.random.default_rng((settings.training.seed, frame.index))
    return list(choose_windows(windows, truth, frame.image.shape[1], settings.mining, rng))


def _add(archive: PatchArchive, frame: Frame, chosen: Sequence[ChosenWindow], stem: str) -> None:
    width = frame.image.shape[1]
    beyond = max((max(-each.box.x, each.box.right - width) for each in chosen), default=0)
    pixels = FramePyramid(frame.image, margin=max(0, beyond))
    for window in chosen:
        box = window.box
        name = f"frame{frame.index + 1:06}_x{box.x:04}_y{box.y:04}_s{box.width:04}"
        patch = to_patch(pixels.crop(box.x, box.y, box.width, box.height), PATCH)
        archive.add(f"{_FOLDERS[window.kind].format(stem)}/{name}.png", patch, window.sides)
