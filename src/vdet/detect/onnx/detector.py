"""A network in an ONNX file as a detector, of the kind `net`."""

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import cv2
import numpy as np

from vdet.boxes import Box, Boxes, Float32Array, Image, Int32Array, Int64Array, clipped
from vdet.config.schema import NetworkSettings
from vdet.detect.classes import our_name
from vdet.detect.factory import DetectorKind
from vdet.detect.onnx.layouts import RawBoxes
from vdet.detect.onnx.preparation import InputForm
from vdet.detect.onnx.recognition import Recognized, read_header, recognize
from vdet.detect.onnx.session import Session
from vdet.draw.boxes import GREEN, draw_box
from vdet.errors import ModelError
from vdet.media import Picture

_MAX_BOXES = 10_000  # before suppression, by highest score

Candidates = tuple[RawBoxes, InputForm, float]
"""The boxes before suppression, the form of the input, and the minimum score."""

SHIPPED = Path(__file__).parents[2] / "models" / "net.onnx"


class NetworkModel:
    """A network with its settings: a `DetectorModel`.

    Raises
    ------
    ModelError
        The file cannot be used, or knows none of the classes in the settings.
    """

    def __init__(self, path: Path, settings: NetworkSettings) -> None:
        self._settings = settings
        self._recognized = recognize(Session(path), settings.class_names or ())
        names, wanted = self._recognized.names, settings.classes
        self._numbers = np.array([*our_classes(names, wanted), -1], np.int32)
        if (self._numbers < 0).all():
            raise ModelError(f"{path}: knows none of detector.classes, only {', '.join(names)}")

    def for_video(self, width: int, height: int, images: Sequence[Image]) -> "NetworkDetector":  # noqa: ARG002
        """Return a detector for frames of one size."""
        network = self._recognized.for_frames(width, height)
        for_stills = self._recognized.for_frames(width, height, are_stills=True)
        return NetworkDetector(network, for_stills, self._numbers, self._settings)


@dataclass(frozen=True, slots=True, eq=False)
class NetworkDetector:
    """Finds vehicles in frames of one size: a `VideoDetector` without state.

    `for_stills` is the network for single images. `numbers` has the index of each class of the
    network in `detector.classes`, -1 for other classes; its last entry, -1, stands for unknown
    classes.
    """

    network: Recognized
    for_stills: Recognized
    numbers: Int32Array
    settings: NetworkSettings
    is_stateless: ClassVar[bool] = True

    @property
    def unknown_classes(self) -> tuple[str, ...]:
        """Classes in the settings that the network does not know, except the default ones."""
        known = [self.settings.classes[number] for number in self.numbers if number >= 0]
        known += NetworkSettings().classes
        return tuple(name for name in self.settings.classes if name not in known)

    def search(self, picture: Picture, index: int | None) -> Candidates:
        """Return the vehicles, in pixels of the frame."""
        network = self.for_stills if index is None else self.network
        raw = network.find(picture, self.settings.min_score)
        boxes = clipped(raw.boxes.astype(np.float64), (picture.width, picture.height))
        is_known = (raw.classes >= 0) & (raw.classes < len(self.numbers))
        numbers = self.numbers[np.where(is_known, raw.classes, -1)]
        keep = (numbers >= 0) & (boxes[:, 2:] - boxes[:, :2] >= 1).all(axis=1)  # not with a NaN
        wanted = self.numbers[:-1, np.newaxis] == np.arange(len(self.settings.classes))
        likely = None if raw.class_scores is None else raw.class_scores[keep] @ wanted
        found = RawBoxes(boxes[keep].astype(np.float32), raw.scores[keep], numbers[keep], likely)
        return found, network.form, self.settings.min_score_still if index is None else 0.0

    def detect(self, candidates: Candidates) -> Boxes:
        """Return one box for each vehicle."""
        raw, form, minimum = candidates
        rows = suppress(raw.boxes, raw.scores, self.settings.nms_iou)
        rows = rows[raw.scores[rows] >= minimum]
        return Boxes(
            raw.boxes[rows],
            raw.scores[rows],
            classes=raw.classes[rows],
            names=self.settings.classes,
            data={} if raw.class_scores is None else {"class_scores": raw.class_scores[rows]},
            trace=(raw, form),
        )

    def stage_pictures(self, image: Image, detections: Boxes) -> dict[str, Image]:
        """Return images of the network's input, and of the boxes before suppression."""
        boxes = image.copy()
        raw, form = detections.trace
        for box, score in zip(raw.boxes.round().astype(int).tolist(), raw.scores, strict=True):
            draw_box(boxes, Box(*box), GREEN, f"{score:.2f}")
        return {"input": form.scaled(Picture(image))[0], "candidates": boxes}


def our_classes(names: Sequence[str], wanted: Sequence[str]) -> list[int]:
    """Return the index in `wanted` of each class of a network, -1 if it is missing."""
    numbers = {name: number for number, name in enumerate(wanted)}
    return [numbers.get(our_name(name) or name.strip().lower(), -1) for name in names]


def suppress(boxes: Float32Array, scores: Float32Array, overlap: float) -> Int64Array:
    """Return the rows of the boxes that are kept, the best first.

    Parameters
    ----------
    boxes
        float32 `(n, 4)`: x1, y1, x2, y2.
    scores
        float32 `(n,)`.
    overlap
        A box is removed if its intersection over union with a better one exceeds this.
    """
    near, far = boxes[:, :2], boxes[:, 2:]
    places = np.concatenate([near, far - near], axis=1, dtype=np.float64)
    kept = cv2.dnn.NMSBoxes(places.tolist(), scores.tolist(), 0.0, overlap, top_k=_MAX_BOXES)
    return np.asarray(kept, np.int64).reshape(-1)


def trained_on(path: Path) -> tuple[str, ...]:
    """Return the names of the sets that our network and its bases were trained on.

    Other networks have no such names.
    """
    header = read_header(Session(path))
    provenance: Any = header.provenance if header else None
    names: list[str] = []
    with contextlib.suppress(LookupError, TypeError, AttributeError):  # written by another program
        while provenance:
            names += (str(source["name"]) for source in provenance["report"]["sources"])
            provenance = provenance.get("base")
    return tuple(dict.fromkeys(names))


NET = DetectorKind(
    NetworkSettings,
    lambda settings, path: NetworkModel(path or SHIPPED, settings),
    lambda _: SHIPPED,
)
