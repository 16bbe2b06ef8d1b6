"""Labelled pictures and videos in memory, from which the training draws."""

import hashlib
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from vdet.boxes import BoolArray, Float32Array, Image, Int64Array
from vdet.config.schema import Settings
from vdet.detect.classes import our_name
from vdet.labels.label import Label
from vdet.labels.pictures import LabelledPicture
from vdet.labels.reading import read_labelled_pictures, read_true_labels
from vdet.labels.roles import Roles
from vdet.media.reader import VideoReader

CLASSES = ("car", "truck", "bus")
"""The classes that the network tells apart, in its order."""

MAX_PIXELS = 640_000
"""Pictures are held with at most this many pixels; larger ones are scaled down."""

UNKNOWN = -1
"""The class of a vehicle whose kind is not known."""

EVERY = 4
"""Every N-th frame of a labelled video is used: neighbours are nearly equal."""


@dataclass(frozen=True, slots=True, eq=False)
class NetSample:
    """A picture with its vehicles.

    Attributes
    ----------
    image
        BGR uint8 `(H, W, 3)`.
    boxes
        float32 `(n, 4)`: x1, y1, x2, y2, pixels of `image`.
    classes
        int64 `(n,)`, `UNKNOWN` for a vehicle whose kind is not known.
    ignored
        bool `(n,)`: the box is an ignore region, neither vehicle nor background.
    """

    image: Image
    boxes: Float32Array
    classes: Int64Array
    ignored: BoolArray

    def shrunk(self) -> "NetSample":
        """Return the sample with at most `MAX_PIXELS` pixels."""
        height, width = self.image.shape[:2]
        factor = (MAX_PIXELS / (height * width)) ** 0.5
        if factor >= 1:
            return self
        size = round(width * factor), round(height * factor)
        image = np.asarray(cv2.resize(self.image, size, interpolation=cv2.INTER_AREA), np.uint8)
        scale = np.array([size[0] / width, size[1] / height] * 2, np.float32)
        return NetSample(image, self.boxes * scale, self.classes, self.ignored)


@dataclass(frozen=True, slots=True)
class SourceReport:
    """The name of a source, its pictures and vehicles, and a SHA-256 of pictures and labels."""

    name: str
    pictures: int
    vehicles: int
    sha256: str


@dataclass(frozen=True, slots=True)
class NetSource:
    """The samples of one camera or collection; metrics and settings use its `name`."""

    name: str
    samples: Sequence[NetSample]

    def report(self) -> SourceReport:
        """Count pictures and vehicles, and compute the SHA-256."""
        digest = hashlib.sha256()
        for sample in self.samples:
            for part in (sample.image, sample.boxes, sample.classes, sample.ignored):
                digest.update(part.tobytes())
        vehicles = sum(int(np.count_nonzero(~sample.ignored)) for sample in self.samples)
        return SourceReport(self.name, len(self.samples), vehicles, digest.hexdigest())


def image_source(path: Path, settings: Settings) -> NetSource:
    """Read a set of labelled pictures into memory; `settings` has the roles of labels.

    Raises
    ------
    TruthError
        The labels cannot be read.
    ImageError
        A picture cannot be read.
    """
    labelled = read_labelled_pictures(path, Roles.from_settings(settings))
    samples = [_sample(each.read(), each) for each in labelled.pictures]
    return NetSource(Path(labelled.name).resolve().name, samples)


def clip_source(video: Path, truth_file: Path, settings: Settings) -> NetSource:
    """Read every `EVERY`-th frame of a labelled video into memory; vehicles without label are cars.

    `settings` has the roles of labels, and how much damage is tolerated.

    Raises
    ------
    TruthError
        The truth cannot be read.
    VideoError
        The video cannot be read, or is too damaged.
    """
    frames: dict[int, list[Label]] = defaultdict(list)
    for label in read_true_labels(truth_file, Roles.from_settings(settings)):
        name = our_name(label.name or "car") or "vehicle"
        frames[label.frame].append(label._replace(name=name))
    samples = []
    with VideoReader(video, frames=max(frames, default=0), settings=settings.input) as reader:
        for number, frame in enumerate(reader, start=1):
            if number % EVERY == 0:
                labelled = LabelledPicture(video, truth_file, tuple(frames[number]))
                samples.append(_sample(frame.image, labelled))
    return NetSource(video.name, samples)


def _sample(image: Image, labelled: LabelledPicture) -> NetSample:
    names, boxes = labelled.classes, labelled.boxes.astype(np.float32)
    classes = [CLASSES.index(name) if name in CLASSES else UNKNOWN for name in names]
    ignored = labelled.ignored | np.array([n not in (*CLASSES, "vehicle") for n in names], np.bool_)
    return NetSample(image, boxes, np.array(classes, np.int64), ignored).shrunk()


def join(samples: Sequence[NetSample], image: Image) -> NetSample:
    """Return a sample that shows `image` with the boxes of all `samples`."""
    return NetSample(
        image,
        np.concatenate([sample.boxes for sample in samples]),
        np.concatenate([sample.classes for sample in samples]),
        np.concatenate([sample.ignored for sample in samples]),
    )
