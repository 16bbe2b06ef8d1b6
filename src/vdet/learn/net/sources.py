"""Labelled images and videos in memory, from which training images are drawn."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, field, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from vdet.boxes import BoolArray, Float32Array, Image, Int64Array
from vdet.config.schema import Settings
from vdet.errors import printable, quantity
from vdet.labels.images import LabelledImage, LabelledImages
from vdet.labels.reading import Roles, read_truth
from vdet.media.reader import VideoReader

MAX_PIXELS = 640_000
"""Images are held with at most this many pixels; larger ones are scaled down."""

UNLABELLED = -1
"""The class of a vehicle whose kind is not known, and of an ignore region for all classes."""

EVERY = 4
"""Every N-th frame of a labelled video is used: neighbours are nearly equal."""


@dataclass(frozen=True, slots=True, eq=False)
class NetSample:
    """An image with its vehicles.

    Attributes
    ----------
    image
        BGR uint8 `(H, W, 3)`.
    boxes
        float32 `(n, 4)`: x1, y1, x2, y2, pixels of `image`.
    classes
        int64 `(n,)`: indices in `train.net.classes`; `UNLABELLED` for a vehicle whose kind is not
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
        return replace(self, image=image, boxes=self.boxes * scale)

    def of(self, rows: BoolArray) -> "NetSample":
        """Return the sample with only some of the boxes."""
        return NetSample(self.image, self.boxes[rows], self.classes[rows], self.ignored[rows])

    def ignoring(self, rows: BoolArray) -> "NetSample":
        """Return the sample with further boxes as ignore regions for all classes."""
        classes = np.where(rows & ~self.ignored, UNLABELLED, self.classes)
        return replace(self, classes=classes, ignored=self.ignored | rows)


def join(samples: Sequence[NetSample], image: Image) -> NetSample:
    """Return a sample that shows `image` with the boxes of all `samples`."""
    return NetSample(
        image,
        np.concatenate([sample.boxes for sample in samples]),
        np.concatenate([sample.classes for sample in samples]),
        np.concatenate([sample.ignored for sample in samples]),
    )


Counts = dict[str, int]
"""The number of boxes by label or class."""


@dataclass(frozen=True, slots=True)
class NetSource:
    """The samples of one camera or collection, and what is learnt from its labels.

    Attributes
    ----------
    name
        Name of the source in the settings.
    vehicles
        The objects to learn by class; "vehicle" are those of unknown kind.
    ignored, background
        The labels that are not learnt: neither object nor background, or background.
    unlabelled
        The classes that the source does not label; what looks like them is not background.
    """

    name: str
    samples: Sequence[NetSample]
    vehicles: Counts = field(default_factory=dict)
    ignored: Counts = field(default_factory=dict)
    background: Counts = field(default_factory=dict)
    unlabelled: tuple[str, ...] = ()

    @property
    def report(self) -> dict[str, Any]:
        """What is learnt, as values for JSON."""
        return {
            "name": self.name,
            "images": len(self.samples),
            "vehicles": self.vehicles,
            "ignored": self.ignored,
            "background": self.background,
            "unlabelled": self.unlabelled,
        }

    def lines(self) -> Iterator[str]:
        """Yield as lines of text what is learnt, and which labels are not known."""
        learnt = _listed(self.vehicles) or "nothing to learn"
        yield f"{self.name}: {quantity(len(self.samples), 'image')}; {learnt}"
        if self.background:
            yield f"  background, as their label is unknown: {_listed(self.background)}"


def _listed(counts: Counts) -> str:
    return ", ".join(f"{count:,} {printable(name)}" for name, count in counts.items())


def image_source(labelled: LabelledImages, settings: Settings) -> NetSource:
    """Read a set of labelled images into memory; `settings` has the classes to learn.

    Raises `ImageError` where an image cannot be read.
    """
    images = ((image.read(), image) for image in labelled.images)
    return _source(Path(labelled.name).resolve().name, images, labelled, settings)


def clip_source(video: Path, truth: Path, settings: Settings) -> NetSource:
    """Read every `EVERY`-th frame of a labelled video into memory; vehicles without label are cars.

    `settings` has the classes to learn, the roles of labels, and how much damage is tolerated.

    Raises
    ------
    TruthError
        The truth cannot be read.
    VideoError
        The video cannot be read, or is too damaged.
    """
    roles = Roles.for_training(settings)
    saved = read_truth(truth, roles)
    used = saved.spread(EVERY, EVERY - 1, saved.length)
    labels = {
        index: [
            replace(track, class_name=roles.class_of(track.class_name or "car") or "vehicle")
            for track in saved.frames.get(index, ())
        ]
        for index in sorted(used)
    }
    ignored = Counter(
        track.class_name or "" for some in labels.values() for track in some if track.ignored
    )
    labelled = LabelledImages(video.name, (), ignored=dict(ignored.most_common()))

    def frames() -> _Frames:
        with VideoReader(video, frames=saved.length, settings=settings.input) as reader:
            for number, frame in enumerate(reader):
                if number in used:
                    yield frame.image, LabelledImage(video, truth, tuple(labels[number]))

    return _source(video.name, frames(), labelled, settings)


_Frames = Iterator[tuple[Image, LabelledImage]]
"""Images, each with its labels."""


def _source(name: str, frames: _Frames, labelled: LabelledImages, settings: Settings) -> NetSource:
    """Read the samples of a source, and count what is learnt and what is not."""
    classes = settings.train.net.classes
    samples = [_sample(image, labels, classes) for image, labels in frames]
    names, vehicles = (*classes, "vehicle"), Counter[str]()
    for sample in samples:
        vehicles.update(names[class_] for class_ in sample.classes[~sample.ignored].tolist())
    unlabelled = {name for image in labelled.images for name in image.unlabelled}
    return NetSource(
        name=name,
        samples=samples,
        vehicles={name: vehicles[name] for name in names if vehicles[name]},
        ignored=dict(labelled.ignored),
        background=dict(labelled.omitted),
        unlabelled=tuple(name for name in classes if name in unlabelled),
    )


def _sample(image: Image, labelled: LabelledImage, classes: Sequence[str]) -> NetSample:
    """Return a sample; the whole image is an ignore region for each class without labels."""
    height, width = image.shape[:2]
    number = {name: index for index, name in enumerate(classes)}
    unlabelled = [number[name] for name in labelled.unlabelled if name in number]
    named = [number.get(label.class_name or "", UNLABELLED) for label in labelled.labels]
    boxes = [astuple(label.box) for label in labelled.labels]
    boxes += [(0, 0, width, height)] * len(unlabelled)
    is_whole = np.repeat([False, True], [len(named), len(unlabelled)])
    sample = NetSample(
        image,
        np.array(boxes, np.float32).reshape(-1, 4),
        np.array([*named, *unlabelled], np.int64),
        is_whole,
    )
    ignored = [*(label.ignored for label in labelled.labels), *[False] * len(unlabelled)]
    return sample.ignoring(np.array(ignored, np.bool_)).shrunk()
