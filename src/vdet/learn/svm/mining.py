"""Mining: cut patches for training out of labelled videos, into a zip file.

Each window of a frame is compared with each vehicle, and some windows of each kind become patches:
vehicles and false alarms. Lengths are in sides of the window, from its centre. A vehicle that is
cut off by the left or right side of the frame is located by its visible side; the other side is
unknown.

Source of mining false alarms: Sung & Poggio, "Example-based Learning for View-based Human Face
Detection", 1998; for HOG and linear SVM, Dalal & Triggs, 2005, section 4.
"""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import Any, Literal

import numpy as np

from vdet.boxes import BoolArray, Box, Float64Array, coverage, cut_sides, from_xywh
from vdet.config.schema import Settings
from vdet.detect.svm.detector import SvmModel
from vdet.detect.svm.model import cut_window, resize
from vdet.detect.svm.windows import Windows
from vdet.errors import DataError, TruthError, VideoError
from vdet.labels.label import boxes_of
from vdet.labels.reading import Roles, read_truth
from vdet.learn.svm.patches import Sides, patch_archive
from vdet.media import Frame, Picture
from vdet.media.reader import VideoReader
from vdet.run.loop import named_errors, peek
from vdet.track.track import Track
from vdet.workers import Progress, no_progress

PatchKind = Literal["vehicle", "box", "false alarm", "part"]
"""`vehicle`: the window fits a vehicle. `box`: it shows one off its centre or of another size.
`false alarm`: classified as a vehicle, but there is none. `part`: classified as a vehicle, but it
shows only a part of one.
"""

_MAX_COVERED = 0.3
"""Maximum fraction of a false alarm covered by a vehicle or an ignore region."""

PATCH = 64
"""Side of the patches, pixels, as in the Udacity set."""

_FOLDERS: dict[PatchKind, str] = {
    "vehicle": "vehicles/mined_{}",
    "box": "boxes/mined_{}",
    "false alarm": "non-vehicles/mined_{}",
    "part": "non-vehicles/mined_{}_parts",
}


@dataclass(frozen=True, slots=True)
class MiningLimits:
    """Maximum numbers of windows to choose in a frame.

    For each vehicle, `per_vehicle` windows that fit it, and as many others that show it. In the
    whole frame, `false_alarms` windows without a vehicle, and `parts` that show only a part of one:
    with many parts, fewer whole vehicles are found. False alarms and parts have at least
    `probability`.
    """

    per_vehicle: int = 16
    false_alarms: int = 15
    parts: int = 10
    probability: float = 0.2


LIMITS = MiningLimits()


@dataclass(frozen=True, slots=True)
class ChosenWindow:
    """A window that becomes a patch, and the sides of the vehicle in it."""

    kind: PatchKind
    box: Box
    sides: Sides | None


def choose_windows(
    windows: Windows,
    labels: Sequence[Track],
    frame_width: int,
    rng: np.random.Generator,
    *,
    limits: MiningLimits,
) -> Iterator[ChosenWindow]:
    """Choose from the windows of a frame, at most as many of each kind as `limits` says.

    Parameters
    ----------
    windows
        All windows of the frame, with the probabilities of the model to improve.
    labels
        The true vehicles and the ignore regions of the frame.
    frame_width
        Width of the frame, pixels.
    """
    _, first = np.unique(windows.boxes, axis=0, return_index=True)
    boxes, vehicles = from_xywh(windows.boxes[first]), _vehicles(labels)
    is_hit = windows.probabilities[first] >= limits.probability
    comparisons = [compare_windows(boxes, vehicle, frame_width) for vehicle in vehicles]
    of_none = np.full(len(boxes), np.inf)
    nearest = np.argmin([of_none, *(item.distances for item in comparisons)], axis=0) - 1
    is_covered = coverage(boxes, boxes_of(sorted(labels, key=attrgetter("ignored")))) > _MAX_COVERED
    is_alarm = is_hit & (nearest < 0) & ~is_covered.any(axis=1)
    is_part = np.zeros(len(boxes), np.bool_)

    def some(kind: PatchKind, flags: BoolArray, limit: int, sides: Any = None) -> Iterator[Any]:
        for row in sorted(rng.permutation(np.flatnonzero(flags))[:limit].tolist()):
            x1, y1, x2, y2 = boxes[row].tolist()
            sides_in_window = None if sides is None else tuple(sides[row].tolist())
            yield ChosenWindow(kind, Box(x1, y1, x2, y2), sides_in_window)

    for number, comparison in enumerate(comparisons):
        is_nearest = nearest == number
        is_part |= is_hit & comparison.part & ~np.delete(is_covered, number, axis=1).any(axis=1)
        yield from some(
            "vehicle", comparison.fits & is_nearest, limits.per_vehicle, comparison.sides
        )
        yield from some("box", comparison.shows & is_nearest, limits.per_vehicle, comparison.sides)
    yield from some("false alarm", is_alarm, limits.false_alarms)
    yield from some("part", is_part, limits.parts)


def _vehicles(labels: Iterable[Track]) -> Float64Array:
    return boxes_of(label for label in labels if not label.ignored)


@dataclass(frozen=True, slots=True, eq=False)
class WindowComparison:
    """What `n` windows show of one vehicle.

    Attributes
    ----------
    sides
        float64 `(n, 4)`: left, top, right, bottom of the vehicle, NaN where the frame cuts it off.
    distances
        float64 `(n,)`: distance of the two centres, the larger of across and down; infinite if the
        window neither fits nor shows the vehicle, nor overlaps it otherwise.
    fits
        bool `(n,)`: the window is a good image of the vehicle.
    shows
        bool `(n,)`: the vehicle is too small, too large or off the centre.
    part
        bool `(n,)`: the window is inside the vehicle, which is far too large for it. It is not an
        image of a vehicle, even if it `shows` one.
    """

    sides: Float64Array
    distances: Float64Array
    fits: BoolArray
    shows: BoolArray
    part: BoolArray


def compare_windows(
    windows: Float64Array, vehicle: Float64Array, frame_width: int
) -> WindowComparison:
    """Compare windows with a vehicle.

    Parameters
    ----------
    windows
        `(n, 4)`: x1, y1, x2, y2 of squares, frame pixels.
    vehicle
        `(4,)`: the same for the part of the vehicle's box inside the frame.
    frame_width
        Width of the frame, pixels.
    """
    size = windows[:, 2] - windows[:, 0]
    middle = (windows[:, :2] + windows[:, 2:]) / 2
    sides = (vehicle - np.tile(middle, 2)) / size[:, np.newaxis]
    across, down = abs(sides[:, :2] + sides[:, 2:]).T / 2
    width, height = (vehicle[2:] - vehicle[:2])[:, np.newaxis] / size
    covered = coverage(windows, vehicle[np.newaxis])[:, 0]

    cut = _beside(vehicle, frame_width)
    if cut.all():
        fits = shows = np.zeros(len(windows), np.bool_)
    elif cut.any():  # its height and its visible side decide
        visible = sides[:, 2] if cut[0] else -sides[:, 0]
        fits = _between(height, 0.35, 0.85) & (down < 0.16) & (covered > 0.3)
        fits &= _between(visible, 0.3, 0.62)
        shows = _between(height, 0.3, 1) & (down < 0.25) & (covered > 0.12)
        shows &= _between(visible, 0.2, 0.8)
    else:
        fits = _between(width, 0.72, 1.3) & (across < 0.16) & (down < 0.16)
        shows = _between(width, 0.4, 2.5) & (across < 0.45) & (down < 0.25)
    part = (covered > 0.5) & ((width > 2.5) | (height > 1.3)) & ~fits
    overlaps = _between(width, 0.4, 3) & (across < 0.75) & (down < 0.4) & (covered > 0.12)
    sides[:, [0, 2]] = np.where(cut, np.nan, sides[:, [0, 2]])
    distances = np.where(overlaps | fits | shows, np.maximum(across, down), np.inf)
    return WindowComparison(sides, distances, fits, shows & ~fits, part)


def _between(values: Float64Array, low: float, high: float) -> BoolArray:
    return (values > low) & (values < high)


def _beside(vehicle: Float64Array, frame_width: int) -> BoolArray:
    """Return whether the left and right side of the frame cut off a box `(4,)`, bool `(2,)`."""
    cut = cut_sides(vehicle, (frame_width, math.inf))
    return np.array([cut.left, cut.right])


@dataclass(frozen=True, slots=True)
class VideoSource:
    """A labelled video.

    Of the labelled frames `first` to `last`, counted from 1, every `every`-th is used, and all in
    which a side of the frame cuts off a vehicle, because these are rare and hard to learn. If
    `last` is None, it is the last labelled frame.
    """

    path: Path
    truth: Path
    every: int = 4
    first: int = 1
    last: int | None = None

    def choose(
        self, model: SvmModel, settings: Settings, limits: MiningLimits, progress: Progress
    ) -> Iterator[tuple[Frame, list[ChosenWindow]]]:
        """Yield the frames to use, with the windows that become patches.

        `progress` receives the name of the video and the number of frames read.

        Raises
        ------
        TruthError
            The ground truth cannot be used, or has no labels for these frames.
        VideoError
            The video cannot be read or searched.
        """
        truth = read_truth(self.truth, Roles.from_settings(settings))
        first, end = self.first - 1, min(self.last or truth.length, truth.length)
        if end <= first:
            raise TruthError(f"{self.truth}: ends at frame {truth.length}; begin earlier")
        regular, labelled = truth.spread(self.every, first, end), truth.frames
        read = 0
        with VideoReader(self.path, frames=end, settings=settings.input) as reader:
            width, advance = reader.info.width, progress(self.path.name, end)
            images, frames = peek(reader)
            with named_errors(self.path, VideoError):
                detector = model.for_video(width, reader.info.height, images)
            for frame in frames:
                read = frame.index + 1
                labels = labelled.get(frame.index, [])
                cuts_off = any(_beside(box, width).any() for box in _vehicles(labels))
                if frame.index in regular or (frame.index >= first and cuts_off):
                    windows, _ = detector.search(Picture(frame.image), None)
                    rng = np.random.default_rng(frame.index)
                    yield frame, list(choose_windows(windows, labels, width, rng, limits=limits))
                advance(1)
        if read < end:
            truth.check_end(self.path, read)


def mine(
    sources: Sequence[VideoSource],
    output: Path,
    settings: Settings,
    model: SvmModel,
    *,
    limits: MiningLimits = LIMITS,
    overwrite: bool = False,
    progress: Progress = no_progress,
) -> tuple[int, Counter[PatchKind]]:
    """Search the labelled frames, and write patches for training.

    The patches of `video.mp4` are in the groups `mined_video` of `vehicles/`, `boxes/` and
    `non-vehicles/`, those of parts in `non-vehicles/mined_video_parts/`. The name of a patch has
    its frame and window.

    Parameters
    ----------
    output
        The zip file to write; `overwrite` replaces an existing one.
    model
        The model whose false alarms to find.
    limits
        Maximum numbers of patches in a frame, and the minimum probability of false alarms.
    progress
        Called for each source with its name and its number of frames.

    Returns
    -------
    The number of frames searched, and of the patches of each kind.

    Raises
    ------
    TruthError
        Labels cannot be used, or there are none for these frames.
    VideoError
        A video cannot be read or searched.
    DataError
        There is nothing to learn from these frames, or two sources have the same name.
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
            for frame, windows in source.choose(model, settings, limits, progress):
                searched += 1
                for chosen in windows:
                    x, y, side, _ = chosen.box.xywh
                    patch = resize(cut_window(frame.image, x, y, side, side), PATCH, PATCH)
                    folder = _FOLDERS[chosen.kind].format(stem)
                    name = f"{folder}/frame{frame.index + 1:06}_x{x:04}_y{y:04}_s{side:04}.png"
                    add(name, patch, chosen.sides)
                    counts[chosen.kind] += 1
        if not counts:
            shown = ", ".join(str(source.path) for source in sources)
            raise DataError(f"{shown}: no window shows a vehicle or a false alarm; use others")
    return searched, counts
