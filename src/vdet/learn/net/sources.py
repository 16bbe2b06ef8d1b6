"""From labelled pictures and videos to the sources of a training."""

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vdet.boxes import BoolArray, Float64Array
from vdet.labels.pictures.labelled import LabelledImages
from vdet.labels.truth import read_truth
from vdet.labels.video import LabelledVideo
from vdet.learn.net.samples import UNKNOWN, Sample, Source
from vdet.media import VideoReader
from vdet.media.images import Image

CLASSES = ("car", "truck", "bus")
"""The classes that the network tells apart, in its order."""

_VEHICLE = "vehicle"


@dataclass(frozen=True, slots=True)
class LabelledClip:
    """A video, the file with its true boxes, and of which frames to learn: each `every`-th."""

    video: Path
    truth: Path
    every: int


@dataclass(frozen=True, slots=True)
class SourceReport:
    """What a source has: its name, pictures, vehicles, and a SHA-256 of pictures and labels."""

    name: str
    pictures: int
    vehicles: int
    sha256: str


def image_source(labelled: LabelledImages) -> tuple[Source, SourceReport]:
    """Read the pictures of a set into memory.

    Raises
    ------
    ImageError
        A picture cannot be read.
    """
    samples = (
        _sample(each.read(), each.boxes, each.classes, each.ignored) for each in labelled.images
    )
    return _source(Path(labelled.name).resolve().name, samples)


def clip_source(clip: LabelledClip) -> tuple[Source, SourceReport]:
    """Read frames of a labelled video into memory; all its vehicles are cars.

    Raises
    ------
    TruthError
        The truth cannot be read.
    VideoError
        The video cannot be read.
    """
    return _source(clip.video.name, _frames(clip, read_truth(clip.truth)))


def _frames(clip: LabelledClip, truth: LabelledVideo) -> Iterator[Sample]:
    with VideoReader(clip.video, frames=truth.last_frame) as reader:
        for number, frame in enumerate(reader, start=1):
            if number % clip.every == 0:
                rows = truth.frame(number)
                names = ["car"] * len(rows)
                yield _sample(frame.image, rows.boxes, names, rows.ignored)


def _sample(image: Image, boxes: Float64Array, names: Sequence[str], ignored: BoolArray) -> Sample:
    corners = np.concatenate([boxes[:, :2], boxes[:, :2] + boxes[:, 2:]], axis=1)
    classes = [CLASSES.index(name) if name in CLASSES else UNKNOWN for name in names]
    is_other = np.array([name not in (*CLASSES, _VEHICLE) for name in names], np.bool_)
    return Sample(
        image, corners.astype(np.float32), np.array(classes, np.int64), ignored | is_other
    ).shrunk()


def _source(name: str, samples: Iterable[Sample]) -> tuple[Source, SourceReport]:
    digest = hashlib.sha256()
    kept = []
    for sample in samples:
        for part in (sample.image, sample.boxes, sample.classes, sample.ignored):
            digest.update(part.tobytes())
        kept.append(sample)
    vehicles = sum(int(np.count_nonzero(~sample.ignored)) for sample in kept)
    return Source(name, kept), SourceReport(name, len(kept), vehicles, digest.hexdigest())
