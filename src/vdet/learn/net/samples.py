"""Labelled pictures in memory, by source, as the training draws them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from vdet.boxes import BoolArray, Float32Array, Int64Array
from vdet.media.images import Image

MAX_PIXELS = 640_000
"""Pictures are held with at most this many pixels; larger ones are made smaller."""

UNKNOWN = -1
"""The class of a vehicle of which only is known that it is one."""


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """A picture with its vehicles.

    Attributes
    ----------
    image
        BGR uint8 `(H, W, 3)`.
    boxes
        float32 `(n, 4)`: x1, y1, x2, y2, pixels of `image`.
    classes
        int64 `(n,)`, `UNKNOWN` where only is known that it is a vehicle.
    ignored
        bool `(n,)`: the box is an ignore region: neither vehicle nor background.
    """

    image: Image
    boxes: Float32Array
    classes: Int64Array
    ignored: BoolArray

    def shrunk(self) -> "Sample":
        """Return the sample with at most `MAX_PIXELS` pixels."""
        height, width = self.image.shape[:2]
        factor = (MAX_PIXELS / (height * width)) ** 0.5
        if factor >= 1:
            return self
        size = round(width * factor), round(height * factor)
        image = np.asarray(cv2.resize(self.image, size, interpolation=cv2.INTER_AREA), np.uint8)
        scale = np.array([size[0] / width, size[1] / height] * 2, np.float32)
        return Sample(image, self.boxes * scale, self.classes, self.ignored)


@dataclass(frozen=True, slots=True)
class Source:
    """The samples of one camera or collection; `name` tells it from others in reports."""

    name: str
    samples: Sequence[Sample]


def join(samples: Iterable[Sample], image: Image) -> Sample:
    """Return a sample that shows `image` with the boxes of all `samples`."""
    parts = list(samples)
    return Sample(
        image,
        np.concatenate([part.boxes for part in parts]),
        np.concatenate([part.classes for part in parts]),
        np.concatenate([part.ignored for part in parts]),
    )
