"""Mining: labelled videos → a zip file of patches for the training.

Vehicles and false alarms are cut out of the frames. `choosing` compares the windows of a frame with
its vehicles and takes some of each kind.

Source of mining false alarms: Sung & Poggio, "Example-based Learning for View-based Human Face
Detection", 1998; for HOG and linear SVM, Dalal & Triggs, 2005, section 4.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from vdet.config.schema import Settings
from vdet.detect.svm.detector import SvmModel
from vdet.detect.svm.features import cut_window, to_patch
from vdet.detect.svm.windows import Windows
from vdet.errors import DataError, TruthError, VideoError
from vdet.labels.label import LabelledVideo, spread_frames
from vdet.labels.reading import read_truth
from vdet.labels.roles import Roles
from vdet.learn.svm.choosing import MOST, Most, PatchKind, choose_windows, cut_sides
from vdet.learn.svm.dataset import patch_archive
from vdet.media import Frame, Picture
from vdet.media.reader import VideoReader
from vdet.progress import Progress, Steps, no_steps
from vdet.run.loop import named_errors, peek

PATCH = 64
"""Side of the patches, pixels, as in the Udacity set."""

_FOLDERS: dict[PatchKind, str] = {
    "vehicle": "vehicles/mined_{}",
    "box": "boxes/mined_{}",
    "false alarm": "non-vehicles/mined_{}",
    "part": "non-vehicles/mined_{}_parts",
}


LabelledFrame = tuple[Frame, Windows, LabelledVideo]
"""A frame with its windows and its labels."""


@dataclass(frozen=True, slots=True)
class VideoSource:
    """A labelled video.

    Of the frames `first` to `last`, counted from 1, that the truth is about, every `every`-th is
    used. Those in which a side of the frame cuts a vehicle off are rare and hard to learn, so all
    of them are used. If `last` is None, it is the last frame of the truth.
    """

    path: Path
    truth: Path
    every: int = 4
    first: int = 1
    last: int | None = None

    def frames(
        self, model: SvmModel, settings: Settings, progress: Progress
    ) -> Iterator[LabelledFrame]:
        """Yield the frames to use; `progress` gets the number of frames that are read.

        Raises
        ------
        TruthError
            The truth cannot be used, or has nothing about these frames.
        VideoError
            The video cannot be read or searched.
        """
        roles = Roles.from_settings(settings)
        truth = read_truth(self.truth, roles)
        last = min(self.last or truth.last_frame, truth.last_frame)
        if last < self.first:
            raise TruthError(f"{self.truth}: ends at frame {truth.last_frame}; begin earlier")
        known = None if truth.known is None else truth.known.tolist()
        regular = spread_frames(known, self.every, self.first, last)
        number = 0
        with VideoReader(self.path, frames=last, settings=settings.input) as reader:
            info, advance = reader.info, progress(last)
            images, frames = peek(reader)
            with named_errors(self.path, VideoError):
                detector = model.for_video(info.width, info.height, images)
            for frame in frames:
                number = frame.index + 1
                labels = truth.frame(number)
                vehicles = labels.boxes[~labels.ignored]
                cuts_off = any(cut_sides(box, info.width).any() for box in vehicles)
                if number in regular or (number >= self.first and cuts_off):
                    windows, _ = detector.search(Picture(frame.image), None)
                    yield frame, windows, labels
                advance(1)
        if number < last:
            truth.check_end(self.truth, number)


def mine(
    sources: Sequence[VideoSource],
    output: Path,
    settings: Settings,
    model: SvmModel,
    *,
    most: Most = MOST,
    overwrite: bool = False,
    steps: Steps = no_steps,
) -> tuple[int, Counter[PatchKind]]:
    """Search the labelled frames and write patches for the training.

    The patches of `video.mp4` lie in the groups `mined_video` of `vehicles/`, `boxes/` and
    `non-vehicles/`. Those of parts lie in `non-vehicles/mined_video_parts/`. The name of a patch
    has its frame and window.

    Parameters
    ----------
    output
        The zip file to write; `overwrite` replaces an existing one.
    model
        The model whose false alarms are searched for.
    most
        Most patches of each kind in a frame, and the minimum probability of false alarms.
    steps
        Called for each source with its name and its number of frames.

    Returns
    -------
    The number of frames searched, and of the patches of each kind.

    Raises
    ------
    TruthError
        Labels cannot be used, or have nothing about the frames.
    VideoError
        A video cannot be read or searched.
    DataError
        There is nothing to learn from these frames, or two sources have one name.
    OutputError
        The zip file cannot be written.
    """
    names = [source.path.resolve().stem for source in sources]
    (name, count), *_ = Counter(names).most_common()
    if count > 1:
        raise DataError(f"{count} sources are named {name}; rename them, or mine one at a time")
    searched, counts = 0, Counter[PatchKind]()
    with patch_archive(output, overwrite=overwrite) as add:
        for stem, source in zip(names, sources, strict=True):
            progress = partial(steps, source.path.name)
            for frame, windows, labels in source.frames(model, settings, progress):
                searched += 1
                rng, width = np.random.default_rng(frame.index), frame.picture.width
                boxes = labels.boxes, labels.ignored
                for chosen in choose_windows(windows, *boxes, width, rng, most=most):
                    x, y, side, _ = chosen.box.xywh
                    patch = to_patch(cut_window(frame.image, x, y, side, side), PATCH)
                    folder = _FOLDERS[chosen.kind].format(stem)
                    name = f"{folder}/frame{frame.index + 1:06}_x{x:04}_y{y:04}_s{side:04}.png"
                    add(name, patch, chosen.sides)
                    counts[chosen.kind] += 1
        if not counts:
            shown = ", ".join(str(source.path) for source in sources)
            raise DataError(f"{shown}: no window shows a vehicle or a false alarm; use others")
    return searched, counts
