"""A network in an ONNX file as a detector, of the kind `net`."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import cv2
import numpy as np

from vdet.boxes import (
    BoolArray,
    Boxes,
    Float64Array,
    Image,
    Int32Array,
    Int64Array,
    are_nested,
    clipped,
    cut_sides,
    iou_matrix,
)
from vdet.config.classes import standard_class
from vdet.config.schema import NetworkSettings
from vdet.detect.onnx.network import COCO, Recognized, Session, recognize
from vdet.draw import GREEN, draw_box
from vdet.errors import ModelError, printable
from vdet.media import Picture

log = logging.getLogger("vdet")

_LARGER = 2.0
"""Pixels of the larger input for a single image, as a multiple of those for a frame of a video."""
_MAX_BOXES = 10_000  # before suppression, those of the highest scores

_SAME_IOU = 0.5
"""Minimum overlap of the boxes of two searches that show one vehicle."""

_BOTH = 1.65
"""Odds of a box that both searches found, as a multiple of the mean odds of the two."""

Candidates = tuple[Sequence[Boxes], bool]
"""The boxes of each search before suppression, and whether it was of a single image."""

_FOUR_WHEELED = "car", "truck", "bus", "vehicle"
_MAX_HEIGHT, _MAX_CUT_HEIGHT = 1.8, 5.0
"""Maximum height of a vehicle with four wheels, in widths, and of the part of one that the left or
right side of the frame cuts; what is higher is a sign, a post or a tree.
"""

_USUAL = NetworkSettings().classes

SHIPPED = Path(__file__).parents[2] / "models" / "net.onnx"


class NetworkModel:
    """A network with its settings: a `DetectorModel`; `path` is its file, None for the shipped one.

    Raises
    ------
    ModelError
        The file cannot be used, or has none of the classes in the settings.
    """

    def __init__(self, settings: NetworkSettings, path: Path | None = None) -> None:
        path = path or SHIPPED
        self._settings = settings
        self._recognized = recognize(Session(path), settings.class_names or ())
        names = self._recognized.names
        self._numbers = np.array([*class_numbers(names, combined_classes(settings)), -1], np.int32)
        detectable = [
            name for number, name in enumerate(settings.classes) if number in self._numbers
        ]
        if not detectable:
            raise ModelError(f"{path}: has none of detector.classes, only {', '.join(names)}")
        if missing := {*settings.classes} - {*detectable, *_USUAL}:
            log.warning("%s: lacks detector.classes %s", path, ", ".join(sorted(missing)))
        unused = [
            name
            for name, number in zip(names, self._numbers.tolist(), strict=False)
            if number == -1 and standard_class(name) is None and name not in COCO
        ]
        if unused and "classes" not in settings.model_fields_set:
            listed = printable(", ".join(unused))
            log.warning("%s: not reported: %s; if vehicles, set detector.classes", path, listed)
        self._seen = set[int]()

    def warnings(self) -> list[str]:
        """Return what is odd about the classes that were found, in all videos and images."""
        highest = max(self._seen, default=1)
        if self._recognized.is_named or 0 < highest < len(COCO):
            return []
        seen = f"its highest class is {highest}; COCO has 0, a person, to {len(COCO) - 1}"
        return [f"the network has no names, and {seen}; set detector.class_names"]

    def for_video(self, width: int, height: int, images: Sequence[Image]) -> "NetworkDetector":  # noqa: ARG002
        """Return a detector for frames of one size."""
        network = self._recognized.for_frames(width, height)
        larger = self._recognized.for_frames(width, height, _LARGER)
        return NetworkDetector(network, larger, self._numbers, self._settings, self._seen)


@dataclass(frozen=True, slots=True, eq=False)
class NetworkDetector:
    """Finds vehicles in frames of one size: a `VideoDetector` without state.

    Our networks search a single image twice, the second time mirrored and with a larger input, as
    `larger`; for networks of other tools, `larger` is `network`. `numbers` has the index of each
    class of the network in `combined_classes`, -1 for other classes; its last entry, -1, stands for
    unknown classes. The classes that the network finds are added to `seen`.
    """

    network: Recognized
    larger: Recognized
    numbers: Int32Array
    settings: NetworkSettings
    seen: set[int] = field(default_factory=set)
    is_stateless: ClassVar[bool] = True

    def search(self, picture: Picture, index: int | None) -> Candidates:
        """Return the vehicles, in pixels of the frame.

        Two searches may name a vehicle differently, so they include the classes that are only
        removed when both are combined.
        """
        settings, is_still = self.settings, index is None
        if not is_still or self.larger is self.network:
            return [self._find(self.network, picture, settings.classes)], is_still
        names = combined_classes(settings)
        image = Picture(np.ascontiguousarray(picture.image[:, ::-1]))
        mirrored = _mirrored(self._find(self.larger, image, names), picture.width)
        return [self._find(self.network, picture, names), mirrored], is_still

    def _find(self, network: Recognized, picture: Picture, names: Sequence[str]) -> Boxes:
        """Return the boxes of the named classes, the first of `combined_classes`, unsuppressed."""
        size = picture.width, picture.height
        found = network.find(picture, self.settings.min_score)
        classes = found[:, 5].astype(np.int64)
        if not network.is_named:
            self.seen.update(classes.tolist())
        sides = clipped(found[:, :4].astype(np.float64), size)
        numbers = self.numbers[classes.clip(-1, len(self.numbers) - 1)]
        rows = (numbers >= 0) & (numbers < len(names))
        rows &= (sides[:, 2:] - sides[:, :2] >= 1).all(axis=1)
        rows &= ~(_have_four_wheels(numbers, names) & _are_too_high(sides, size))
        data = {}
        if found.shape[1] > 6:
            means_name = self.numbers[:-1, np.newaxis] == np.arange(len(names))
            data["class_scores"] = found[rows, 6:] @ means_name
        return Boxes(sides[rows], found[rows, 4], classes=numbers[rows], names=names, data=data)

    def detect(self, candidates: Candidates) -> Boxes:
        """Return one box for each vehicle."""
        settings, names = self.settings, self.settings.classes
        searches, is_still = candidates
        boxes, *mirrored = (suppress(boxes, settings.nms_iou) for boxes in searches)
        if mirrored:
            boxes = combine(boxes, mirrored[0], settings.nms_iou)
        assert boxes.classes is not None
        rows = (boxes.scores >= settings.min_score) & (boxes.classes < len(names))
        if is_still:
            rows &= boxes.reach(settings.min_score_still, settings.class_minima)
            large = np.flatnonzero(rows & _have_four_wheels(boxes.classes, names))
            nested = are_nested(boxes.sides[large], boxes.scores[large])
            rows[large[nested]] = False  # a lorry and its body
        return Boxes(
            boxes.sides[rows],
            boxes.scores[rows],
            classes=boxes.classes[rows],
            names=names,
            data={name: column[rows, : len(names)] for name, column in boxes.data.items()},
            trace=searches,
        )

    def stage_images(self, image: Image, detections: Boxes) -> dict[str, Image]:
        """Return images of the network's input, and of the boxes before suppression."""
        candidates = image.copy()
        for boxes in detections.trace:
            for candidate in boxes:
                draw_box(candidates, candidate.box, GREEN, f"{candidate.score:.2f}")
        return {"input": self.network.form.scaled(Picture(image)), "candidates": candidates}


def _have_four_wheels(classes: Int32Array, names: Sequence[str]) -> BoolArray:
    """Return for each index in `names`, `(n,)`, whether such vehicles have four wheels."""
    return np.isin(classes, [n for n, name in enumerate(names) if name in _FOUR_WHEELED])


def _are_too_high(sides: Float64Array, size: tuple[int, int]) -> BoolArray:
    """Return for each box, `(n, 4)`, whether it is too high for a vehicle with four wheels.

    A picture of this `size` may cut off a part of a vehicle on the left or right.
    """
    cut = cut_sides(sides.T, size)
    highest = np.where(cut.left | cut.right, _MAX_CUT_HEIGHT, _MAX_HEIGHT)
    return np.asarray(sides[:, 3] - sides[:, 1] > highest * (sides[:, 2] - sides[:, 0]))


def _mirrored(boxes: Boxes, width: int) -> Boxes:
    """Return the boxes in the mirror image of a picture of this width."""
    sides = boxes.sides.copy()
    sides[:, [2, 0]] = width - boxes.sides[:, [0, 2]]
    return Boxes(sides, boxes.scores, classes=boxes.classes, names=boxes.names, data=boxes.data)


def suppress(boxes: Boxes, overlap: float) -> Boxes:
    """Return the boxes that are kept, the best first.

    A box is removed if its intersection over union with a better one exceeds `overlap`.
    """
    scores: Any = boxes.scores  # typed as a list, like the boxes
    xywh: Any = boxes.sides.copy()
    xywh[:, 2:] -= xywh[:, :2]
    kept = cv2.dnn.NMSBoxes(xywh, scores, 0.0, overlap, top_k=_MAX_BOXES)
    return boxes[np.asarray(kept, np.int64)]


def combine(first: Boxes, second: Boxes, overlap: float) -> Boxes:
    """Return the boxes of two searches of one picture, the best first; both have `class_scores`.

    Two boxes that overlap each other the most become their mean, weighted by score. Its score is
    the geometric mean of the odds of both, raised by a constant; a box that one search did not find
    keeps half its score. With both rules, fitted to cameras that were held out from a training run,
    the score stays the fraction of boxes that are right. Then a box is removed if its intersection
    over union with a better one exceeds `overlap`, or that of boxes of one vehicle.

    Source: Solovyev, Wang and Gabruseva, "Weighted boxes fusion: Ensembling boxes from different
    object detection models", 2021.
    """
    rows, columns = _pairs(first.sides, second.sides)
    a, b = first.scores[rows], second.scores[columns]
    weights = (b / (a + b))[:, np.newaxis]
    right, wrong = _BOTH * np.sqrt(a * b), np.sqrt((1 - a) * (1 - b))

    def merged(of_first: Float64Array, of_second: Float64Array) -> Float64Array:
        means = of_first.copy()
        means[rows] += weights * (of_second[columns] - of_first[rows])
        return np.concatenate([means, np.delete(of_second, columns, axis=0)])

    scores = np.concatenate([first.scores, np.delete(second.scores, columns)]) / 2
    scores[rows] = right / (right + wrong)
    class_scores = merged(first.data["class_scores"], second.data["class_scores"])
    boxes = Boxes(
        merged(first.sides, second.sides),
        scores,
        classes=class_scores.argmax(axis=1),
        names=first.names,
        data={"class_scores": class_scores},
    )
    return suppress(boxes, min(overlap, _SAME_IOU))


def _pairs(first: Float64Array, second: Float64Array) -> tuple[Int64Array, Int64Array]:
    """Return the rows of both lists whose boxes overlap each other the most."""
    if not (len(first) and len(second)):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    ious = iou_matrix(first, second)
    columns = ious.argmax(axis=1)
    rows = np.arange(len(first))
    is_pair = (ious.argmax(axis=0)[columns] == rows) & (ious[rows, columns] >= _SAME_IOU)
    return rows[is_pair], columns[is_pair]


def combined_classes(settings: NetworkSettings) -> tuple[str, ...]:
    """Return the classes in the settings, then the other usual ones."""
    return tuple(dict.fromkeys((*settings.classes, *_USUAL)))


def class_numbers(names: Sequence[str], chosen: Sequence[str]) -> list[int]:
    """Return the index in `chosen` of each class of a network, -1 if it is missing."""
    numbers = {name: number for number, name in enumerate(chosen)}
    return [numbers.get(standard_class(name) or name.strip().lower(), -1) for name in names]


def shipped_network(_: NetworkSettings) -> Path:
    """Return the file of the shipped network."""
    return SHIPPED
