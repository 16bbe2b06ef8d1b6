"""The labels of a video: as read from a file, and as columns for metrics."""

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from operator import attrgetter
from pathlib import Path

import numpy as np

from vdet.boxes import BoolArray, Box, Float64Array, Int64Array
from vdet.detect.classes import our_name
from vdet.errors import TruthError
from vdet.labels.label import Label
from vdet.track.track import FrameTracks, Track


@dataclass(frozen=True, slots=True)
class SavedTracks:
    """The tracks of a video, read from a file.

    Attributes
    ----------
    labels
        The boxes, exactly as in the file.
    known
        The frames that the file is about, also those without a box, counted from 0, ascending;
        None: all up to its last box.
    times
        Seconds of each frame with a time in the file; empty if the format has no times.
    size
        Width and height of the frames in pixels; None if the file does not contain them.
    begin
        The moment of time 0, if the file has it.
    """

    labels: tuple[Label, ...]
    known: Sequence[int] | None = None
    times: Mapping[int, float] = field(default_factory=dict)
    size: tuple[int, int] | None = None
    begin: datetime | None = None

    @property
    def rate(self) -> float | None:
        """Frames per second from the first time to the last; None if that is not known."""
        first, last = min(self.times, default=0), max(self.times, default=0)
        seconds = self.times[last] - self.times[first] if self.times else 0.0
        return (last - first) / seconds if seconds > 0 else None

    @property
    def has_times(self) -> bool:
        """Whether every frame has a time; if not, pass a rate to `at_rate`."""
        return all(index in self.times for index in self._indices())

    def at_rate(self, rate: float) -> "SavedTracks":
        """Return the same tracks; frames without a time get that of `rate` frames per second."""
        times = {index: index / rate for index in self._indices()}
        return replace(self, times=times | dict(self.times))

    def __iter__(self) -> Iterator[FrameTracks]:
        """Yield the frames with a box and the known frames, in order.

        Boxes are rounded to whole pixels, and scores lie between 0 and 1. A class is one of
        `OUR_NAMES` if the label means one, else the label. An unknown time is NaN: see `has_times`.
        """
        by_frame: dict[int, list[Label]] = defaultdict(list)
        for label in self.labels:
            by_frame[label.frame - 1].append(label)
        for index in self._indices():
            labels = sorted(by_frame[index], key=attrgetter("id"))
            time = self.times.get(index, math.nan)
            yield FrameTracks(index, time, tuple(map(_track, labels)))

    def _indices(self) -> list[int]:
        return sorted({label.frame - 1 for label in self.labels}.union(self.known or ()))


def _track(label: Label) -> Track:
    _, box, name, _, number, score, _, state, foot, metres, lane = label
    whole, score = Box.sized(*Box(*box).xywh), min(max(score, 0.0), 1.0)
    named = None if name is None else our_name(name) or name
    return Track(number, whole, score, state, named, foot, metres, lane)


def spread_frames(known: Iterable[int] | None, every: int, first: int, last: int) -> set[int]:
    """Return numbers of frames from `first` to `last`, each at least `every` after the one before.

    Only the `known` ones are taken, which ascend; None: any.
    """
    chosen, wanted = set(), first
    for number in range(first, last + 1) if known is None else known:
        if wanted <= number <= last:
            chosen.add(number)
            wanted = number + every
    return chosen


@dataclass(frozen=True, slots=True, eq=False)
class LabelledVideo:
    """The boxes of a video, one row each, ordered by frame.

    Attributes
    ----------
    frames
        int64 `(n,)`: number of the frame, from 1, ascending.
    ids
        int64 `(n,)`: id of the vehicle. No id occurs twice in a frame, except `NO_ID`.
    boxes
        float64 `(n, 4)`: x1, y1, x2, y2 in full-frame pixels from 0, each with an area.
    scores
        float64 `(n,)`: confidence of a prediction, higher is better; 1 for truth.
    ignored
        bool `(n,)`. In truth: the row is an ignore region, not a vehicle to be found. In
        predictions: the row counts only if it finds a vehicle.
    frame_count
        Number of frames of the video, None if it is not known.
    rate
        Frames per second, None if they are not known.
    known
        int64: numbers of the frames that the labels are about, ascending; of the others nothing is
        known. None: all frames.
    classes
        The class of each vehicle by its id, the last one that it has; without those not known.
    """

    frames: Int64Array
    ids: Int64Array
    boxes: Float64Array
    scores: Float64Array
    ignored: BoolArray
    frame_count: int | None = None
    rate: float | None = None
    known: Int64Array | None = None
    classes: Mapping[int, str] = field(default_factory=dict)

    @staticmethod
    def of(
        labels: Iterable[Label],
        *,
        frame_count: int | None = None,
        rate: float | None = None,
        known: Sequence[int] | None = None,
    ) -> "LabelledVideo":
        """Order labels by frame, without checks; those of one frame keep their order.

        `known` are the frames that they are about, from 0.
        """
        ordered = sorted(labels, key=lambda label: label.frame)
        return LabelledVideo(
            frames=np.array([label.frame for label in ordered], np.int64),
            ids=np.array([label.id for label in ordered], np.int64),
            boxes=np.array([label.box for label in ordered], np.float64).reshape(-1, 4),
            scores=np.array([label.score for label in ordered], np.float64),
            ignored=np.array([label.ignored for label in ordered], np.bool_),
            frame_count=frame_count,
            rate=rate,
            known=None if known is None else np.array(known, np.int64) + 1,
            classes={
                label.id: our_name(label.name) or label.name
                for label in ordered
                if label.name and not label.ignored
            },
        )

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def last_frame(self) -> int:
        """Number of the last known frame of the video; 0 if there is none."""
        return max(self.frame_count or 0, int(self.frames[-1]) if len(self) else 0)

    def check_end(self, path: Path, frames: int) -> None:
        """Refuse boxes of the file `path` beyond a video's last frame. Raises `TruthError`."""
        last = int(self.frames.max(initial=0))
        if last > frames:
            what = f"has a box in frame {last} of a video of {frames}; is it another video's?"
            raise TruthError(f"{path}: {what}")

    def frame(self, number: int) -> "LabelledVideo":
        """Return the rows of one frame, counted from 1, in their order."""
        first, end = np.searchsorted(self.frames, [number, number + 1])
        return self.where(slice(int(first), int(end)))

    def until(self, last: int) -> "LabelledVideo":
        """Return the frames 1 to `last` as a video of that many frames."""
        return replace(self.where(self.frames <= last), frame_count=last)

    def where(self, rows: slice | BoolArray) -> "LabelledVideo":
        """Return only these rows, in their order."""
        columns = ("frames", "ids", "boxes", "scores", "ignored")
        return replace(self, **{name: getattr(self, name)[rows] for name in columns})
