"""Objects of rare classes, pasted into training pictures with some of their surroundings.

Source: Ghiasi et al., "Simple Copy-Paste is a Strong Data Augmentation Method", 2021.
"""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from vdet.boxes import Float32Array, Image, iou_matrix
from vdet.learn.net.sources import NetSample

_PASTED = 0.3  # fraction of pictures that get pasted objects
_MOST = 3  # objects in a picture
_RARE = 0.5  # a class with fewer objects than this fraction of the mean is rare
_MARGIN = 0.2  # surroundings on each side, fraction of the box
_LEAST_SIDE = 24.0  # longer side of an object to paste, pixels
_SIDES = (
    16.0,
    0.4,
)  # minimum longer side when pasted, pixels; the longest as a fraction of the height
_MOST_COVERED = 0.2  # of another object by the pasted one


class Paster:
    """Pastes objects of the rare classes in `samples` into pictures."""

    def __init__(self, samples: Sequence[NetSample]) -> None:
        self._samples = samples
        objects: dict[int, list[tuple[int, int]]] = {}
        for number, sample in enumerate(samples):
            for row in _whole(sample):
                objects.setdefault(int(sample.classes[row]), []).append((number, row))
        limit = _RARE * np.mean([len(object_) for object_ in objects.values()]) if objects else 0.0
        self._rare = [item for _, item in sorted(objects.items()) if len(item) < limit]

    def paste(self, rng: np.random.Generator, sample: NetSample) -> NetSample:
        """Return the sample, sometimes with objects of rare classes pasted into it."""
        if not self._rare or rng.random() >= _PASTED:
            return sample
        image = sample.image.copy()
        sample = replace(sample, image=image)
        for _ in range(int(rng.integers(1, _MOST + 1))):
            rare = self._rare[int(rng.integers(len(self._rare)))]
            number, row = rare[int(rng.integers(len(rare)))]
            sample = _paste(rng, sample, self._samples[number], row)
        return sample


def _whole(sample: NetSample) -> list[int]:
    """Return the rows of the objects that are large, inside the picture, and not hidden."""
    height, width = sample.image.shape[:2]
    boxes = sample.boxes.astype(np.float64)
    overlaps = iou_matrix(boxes, boxes) - np.eye(len(boxes))
    overlaps[:, sample.ignored & (sample.classes >= 0)] = 0  # the whole picture
    large = (boxes[:, 2:] - boxes[:, :2]).max(1, initial=0) >= _LEAST_SIDE
    inside = (boxes[:, :2] > 1).all(1) & (boxes[:, 2:] < np.array([width, height]) - 1).all(1)
    apart = overlaps.max(1, initial=0) < 0.1
    known = ~sample.ignored & (sample.classes >= 0)
    return [int(row) for row in np.flatnonzero(large & inside & apart & known)]


def _paste(rng: np.random.Generator, sample: NetSample, donor: NetSample, row: int) -> NetSample:
    """Paste one object into the image of a sample, unless it would cover others."""
    height, width = sample.image.shape[:2]
    box = donor.boxes[row]
    longer = float((box[2:] - box[:2]).max())
    minimum, most = _SIDES[0], min(_SIDES[1] * height, 1.5 * longer)
    scale = float(np.exp(rng.uniform(np.log(minimum), np.log(max(minimum, most))))) / longer
    patch, inner = _patch(donor.image, box, scale)
    rows, columns = patch.shape[:2]
    if rows >= height or columns >= width:
        return sample
    left = int(rng.integers(width - columns))
    top = int(rng.integers(height // 4, max(height // 4 + 1, height - rows)))
    place = inner + np.array([left, top] * 2, np.float32)
    if top + rows > height or _covers(place, sample.boxes[~sample.ignored]):
        return sample
    alpha = _feather(patch.shape[:2], inner)
    part = sample.image[top : top + rows, left : left + columns]
    part[:] = (alpha * patch + (1 - alpha) * part).astype(np.uint8)
    return replace(
        sample,
        boxes=np.concatenate([sample.boxes, place[np.newaxis]]),
        classes=np.append(sample.classes, donor.classes[row]),
        ignored=np.append(sample.ignored, False),
    )


def _patch(image: Image, box: Float32Array, scale: float) -> tuple[Image, Float32Array]:
    """Return an object with its surroundings, and its box there, both scaled."""
    height, width = image.shape[:2]
    margin = _MARGIN * np.tile(box[2:] - box[:2], 2) * (-1, -1, 1, 1)
    around = np.clip(box + margin, 0, (width, height, width, height)).round().astype(int)
    left, top, right, bottom = around.tolist()
    method = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    patch = cv2.resize(
        image[top:bottom, left:right], None, fx=scale, fy=scale, interpolation=method
    )
    inner = (box - np.array([left, top] * 2)) * scale
    return np.asarray(patch, np.uint8), inner.astype(np.float32)


def _feather(shape: tuple[int, int], inner: Float32Array) -> Float32Array:
    """Return the opacity of a patch `(H, W, 1)`: 1 in the box, falling to 0 at its sides."""
    ramps = []
    for count, near, far in ((shape[0], inner[1], inner[3]), (shape[1], inner[0], inner[2])):
        middles = np.arange(count) + 0.5
        before, after = middles / max(near, 1.0), (count - middles) / max(count - far, 1.0)
        ramps.append(np.clip(np.minimum(before, after), 0, 1))
    return np.asarray(np.minimum(ramps[0][:, None], ramps[1])[..., None], np.float32)


def _covers(place: Float32Array, boxes: Float32Array) -> bool:
    """Return whether an object at `place` would hide a part of others, or lie on them."""
    near, far = np.maximum(boxes[:, :2], place[:2]), np.minimum(boxes[:, 2:], place[2:])
    common = np.maximum(far - near, 0).prod(axis=1)
    areas = np.maximum((boxes[:, 2:] - boxes[:, :2]).prod(axis=1), 1e-6)
    return bool((common / areas > _MOST_COVERED).any())
