"""Labelled pictures and videos in memory, from which the training draws."""

import hashlib
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from vdet.boxes import BoolArray, Float32Array, Image, Int64Array
from vdet.config.schema import Settings
from vdet.labels.label import Label
from vdet.labels.pictures import LabelledPicture, LabelledPictures
from vdet.labels.reading import read_labelled_pictures, read_true_labels
from vdet.labels.roles import Roles
from vdet.labels.video import spread_frames
from vdet.media.reader import VideoReader

MAX_PIXELS = 640_000
"""Pictures are held with at most this many pixels; larger ones are scaled down."""

UNKNOWN = -1
"""The class of a vehicle whose kind is not known, and of an ignore region for all classes."""

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
        int64 `(n,)`: indices in `train.net.classes`; `UNKNOWN` for a vehicle whose kind is not
        known.
    ignored
        bool `(n,)`: the box is an ignore region, neither vehicle nor background. With a class, it
        is one only where the network sees that class.
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

    def ignoring(self, rows: BoolArray) -> "NetSample":
        """Return the sample with further boxes as ignore regions for all classes."""
        classes = np.where(rows & ~self.ignored, UNKNOWN, self.classes)
        return replace(self, classes=classes, ignored=self.ignored | rows)


Counts = dict[str, int]
"""The number of boxes by label or class."""


@dataclass(frozen=True, slots=True)
class SourceReport:
    """What a training makes of a source.

    Attributes
    ----------
    vehicles
        The objects to learn by class; "vehicle" are those of unknown kind.
    ignored, background
        The labels that are not learnt: neither object nor background, or background.
    unlabelled
        The classes that the source does not label; what looks like them is not background.
    sha256
        Of pictures and labels.
    """

    name: str
    pictures: int
    vehicles: Counts
    ignored: Counts
    background: Counts
    unlabelled: tuple[str, ...]
    sha256: str


@dataclass(frozen=True, slots=True)
class NetSource:
    """The samples of one camera or collection; metrics and settings use its `name`."""

    name: str
    samples: Sequence[NetSample]


Source = tuple[NetSource, SourceReport]
"""A source, and what a training makes of it."""


def image_source(path: Path, settings: Settings) -> Source:
    """Read a set of labelled pictures into memory.

    `settings` has the classes to learn and the roles of labels.

    Raises
    ------
    TruthError
        The labels cannot be read.
    ImageError
        A picture cannot be read.
    """
    labelled = read_labelled_pictures(path, Roles.for_training(settings))
    classes = settings.train.net.classes
    samples = [_sample(picture.read(), picture, classes) for picture in labelled.pictures]
    source = NetSource(Path(labelled.name).resolve().name, samples)
    return source, _report(source, classes, labelled)


def clip_source(video: Path, truth_file: Path, settings: Settings) -> Source:
    """Read every `EVERY`-th frame of a labelled video into memory; vehicles without label are cars.

    `settings` has the classes to learn, the roles of labels, and how much damage is tolerated.

    Raises
    ------
    TruthError
        The truth cannot be read.
    VideoError
        The video cannot be read, or is too damaged.
    """
    frames: dict[int, list[Label]] = defaultdict(list)
    roles = Roles.for_training(settings)
    truth = read_true_labels(truth_file, roles)
    for label in truth.labels:
        name = roles.class_of(label.name or "car") or "vehicle"
        frames[label.frame].append(label._replace(name=name))
    samples, last = [], max(frames, default=0)
    known = None if truth.known is None else (index + 1 for index in truth.known)
    used = spread_frames(known, EVERY, EVERY, last)
    with VideoReader(video, frames=last, settings=settings.input) as reader:
        for number, frame in enumerate(reader, start=1):
            if number in used:
                labelled = LabelledPicture(video, truth_file, tuple(frames[number]))
                samples.append(_sample(frame.image, labelled, settings.train.net.classes))
    source, classes = NetSource(video.name, samples), settings.train.net.classes
    return source, _report(source, classes, LabelledPictures(video.name, ()))


def _report(source: NetSource, classes: Sequence[str], labelled: LabelledPictures) -> SourceReport:
    """Count what is learnt and what is not, and compute the SHA-256."""
    digest = hashlib.sha256()
    names, vehicles = (*classes, "vehicle"), Counter[str]()
    for sample in source.samples:
        for part in (sample.image, sample.boxes, sample.classes, sample.ignored):
            digest.update(part.tobytes())
        vehicles.update(names[class_] for class_ in sample.classes[~sample.ignored].tolist())
    unlabelled = {name for picture in labelled.pictures for name in picture.unlabelled}
    return SourceReport(
        source.name,
        len(source.samples),
        {name: vehicles[name] for name in names if vehicles[name]},
        dict(labelled.ignored),
        dict(labelled.others),
        tuple(name for name in classes if name in unlabelled),
        digest.hexdigest(),
    )


def _sample(image: Image, labelled: LabelledPicture, classes: Sequence[str]) -> NetSample:
    """Return a sample; the whole picture is an ignore region for each class without labels."""
    whole = np.array([[0, 0, image.shape[1], image.shape[0]]] * len(classes), np.float32)
    unlabelled = [classes.index(name) for name in labelled.unlabelled if name in classes]
    named = [classes.index(name) if name in classes else UNKNOWN for name in labelled.classes]
    objects = NetSample(
        image,
        labelled.boxes.astype(np.float32),
        np.array(named, np.int64),
        np.zeros(len(named), np.bool_),
    ).ignoring(labelled.ignored)
    regions = NetSample(
        image,
        whole[: len(unlabelled)],
        np.array(unlabelled, np.int64),
        np.ones(len(unlabelled), np.bool_),
    )
    return join([objects, regions], image).shrunk()


def join(samples: Sequence[NetSample], image: Image) -> NetSample:
    """Return a sample that shows `image` with the boxes of all `samples`."""
    return NetSample(
        image,
        np.concatenate([sample.boxes for sample in samples]),
        np.concatenate([sample.classes for sample in samples]),
        np.concatenate([sample.ignored for sample in samples]),
    )
