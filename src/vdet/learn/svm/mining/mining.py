"""From labelled videos and pictures, frame by frame, to a zip file of patches."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from vdet.config.schema import Settings
from vdet.detect.protocol import DetectorModel
from vdet.detect.svm.features import cut_window, to_patch
from vdet.errors import DataError
from vdet.learn.svm.dataset import PatchArchive, patch_archive
from vdet.learn.svm.mining.choosing import ChosenWindow, PatchKind, choose_windows
from vdet.learn.svm.mining.sources import LabelledFrame, PictureSource, VideoSource
from vdet.progress import Steps, no_steps

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
    """What is mined, and the zip file to write; `overwrite`: replace one that is there."""

    sources: tuple[VideoSource | PictureSource, ...]
    output: Path
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
    job: MiningJob, settings: Settings, model: DetectorModel | None, *, steps: Steps = no_steps
) -> MiningResult:
    """Search the labelled frames and write patches for the training.

    Patches of `video.mp4` lie in the groups `mined_video` of `vehicles/`, `boxes/` and
    `non-vehicles/`, those of parts in `non-vehicles/mined_video_parts/`; frame and window are in
    their names.

    Parameters
    ----------
    model
        The detector whose false alarms are searched for; None: any window without a vehicle may be
        taken.
    steps
        Called for each source with its name and its number of frames.

    Raises
    ------
    TruthError
        Labels cannot be used, or have nothing about the frames.
    VideoError, ImageError
        A video or a picture cannot be read or searched.
    DataError
        There is nothing to learn from these frames, or two sources have one name.
    OutputError
        The zip file cannot be written.
    """
    names = [source.path.resolve().stem for source in job.sources]
    for name, count in Counter(names).items():
        if count > 1:
            raise DataError(f"{count} sources are named {name}; rename them, or mine one at a time")
    searched = 0
    counts: Counter[PatchKind] = Counter()
    with patch_archive(job.output, overwrite=job.overwrite) as archive:
        for name, source in zip(names, job.sources, strict=True):
            progress = partial(steps, source.path.name)
            for frame in source.frames(model, settings, progress):
                searched += 1
                chosen = _choose(frame, settings)
                _add(archive, frame, chosen, name)
                counts.update(window.kind for window in chosen)
        if not counts:
            shown = ", ".join(str(source.path) for source in job.sources)
            raise DataError(f"{shown}: no window fits a vehicle or is a false alarm; try others")
    kinds: tuple[PatchKind, ...] = ("vehicle", "box", "false alarm", "part")
    return MiningResult(searched, *(counts[kind] for kind in kinds))


def _choose(frame: LabelledFrame, settings: Settings) -> list[ChosenWindow]:
    """Choose at random, with a seed that depends on the frame alone."""
    rng = np.random.default_rng((settings.train.svm.seed, frame.number))
    width = frame.image.shape[1]
    return list(choose_windows(frame.windows, frame.labels, width, settings.train.mine, rng))


def _add(
    archive: PatchArchive, frame: LabelledFrame, chosen: Sequence[ChosenWindow], stem: str
) -> None:
    for window in chosen:
        x, y, width, height = window.box.xywh
        name = f"{frame.name}_x{x:04}_y{y:04}_s{width:04}"
        patch = to_patch(cut_window(frame.image, x, y, width, height), PATCH)
        archive.add(f"{_FOLDERS[window.kind].format(stem)}/{name}.png", patch, window.sides)
