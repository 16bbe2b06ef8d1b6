"""A network in an ONNX file as a detector."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from vdet.boxes import Box, Boxes, Float32Array, Int32Array, Int64Array
from vdet.config.schema import NetworkSettings
from vdet.detect.classes import our_name
from vdet.detect.onnx.layouts import RawBoxes
from vdet.detect.onnx.preparation import Placement
from vdet.detect.onnx.recognition import Recognized, recognize
from vdet.detect.onnx.session import Session
from vdet.draw.boxes import GREEN, draw_box
from vdet.errors import ModelError
from vdet.media import Picture
from vdet.media.images import Image


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """The vehicles that the network finds, before suppression, in pixels of the frame."""

    raw: RawBoxes
    is_still: bool


class NetworkModel:
    """A network with its settings: a `DetectorModel`.

    Raises
    ------
    ModelError
        The file cannot be used, or knows none of the classes in the settings.
    """

    def __init__(self, path: Path, settings: NetworkSettings) -> None:
        self._settings = settings
        self._session = Session(path)
        self._recognized = recognize(self._session, path, settings.names or ())
        names, wanted = self._recognized.names, settings.classes
        self._numbers = np.array(our_classes(names, wanted), np.int32)
        if (self._numbers < 0).all():
            raise ModelError(
                f"{path}: knows none of detector.classes ({', '.join(wanted)}); it knows "
                f"{', '.join(names)}"
            )

    def for_video(
        self,
        width: int,
        height: int,
        images: Sequence[Image],  # noqa: ARG002 - its size is enough
    ) -> "NetworkDetector":
        """Return a detector for frames of one size."""
        recognized = self._recognized.for_frames(width, height)
        return NetworkDetector(self._session, recognized, self._numbers, self._settings)


class NetworkDetector:
    """Finds vehicles in frames of one size: a `VideoDetector`; it remembers nothing.

    Parameters
    ----------
    numbers
        int32: for each class of the network its number in `detector.classes`, -1 for others.
    """

    def __init__(
        self,
        session: Session,
        recognized: Recognized,
        numbers: Int32Array,
        settings: NetworkSettings,
    ) -> None:
        self._session = session
        self._recognized = recognized
        self._numbers = numbers
        self._settings = settings

    def search(self, picture: Picture, index: int | None) -> Candidates:
        """Run the network on a frame; several threads may call this at once."""
        values, place = self._recognized.form.prepare(picture)
        outputs = self._session.run(self._recognized.feed(self._session, values))
        raw = self._recognized.layout.decode(outputs, self._settings.least)
        return Candidates(
            self._wanted(raw, place, picture.width, picture.height), is_still=index is None
        )

    def detect(self, candidates: Candidates) -> Boxes:
        """Return one box for each vehicle."""
        raw = candidates.raw
        rows = suppress(raw.boxes, raw.scores, self._settings.overlap)
        if candidates.is_still:
            rows = rows[raw.scores[rows] >= self._settings.still_score]
        return Boxes(
            raw.boxes[rows],
            raw.scores[rows],
            classes=raw.classes[rows],
            names=self._settings.classes,
            trace=raw,
        )

    def stage_pictures(self, image: Image, detections: Boxes) -> dict[str, Image]:
        """Return what the network sees, and its boxes before suppression."""
        values, _ = self._recognized.form.prepare(Picture(image))
        boxes = image.copy()
        raw: RawBoxes = detections.trace
        for box, score in zip(raw.boxes.round().astype(int).tolist(), raw.scores, strict=True):
            draw_box(boxes, Box(*box), GREEN, f"{score:.2f}")
        return {"input": self._recognized.form.picture(values), "candidates": boxes}

    def _wanted(self, raw: RawBoxes, place: Placement, width: int, height: int) -> RawBoxes:
        """Return the boxes of vehicles in the frame's pixels, as far as they lie in it."""
        boxes = np.clip(place.to_frame(raw.boxes), 0, [width, height, width, height])
        sides = boxes[:, 2:] - boxes[:, :2]
        is_known = (raw.classes >= 0) & (raw.classes < len(self._numbers))
        numbers = np.where(is_known, self._numbers[np.where(is_known, raw.classes, 0)], -1)
        keep = (sides >= 1).all(axis=1) & (numbers >= 0) & np.isfinite(boxes).all(axis=1)
        return RawBoxes(
            boxes[keep].astype(np.float32), raw.scores[keep], numbers[keep].astype(np.int32)
        )


def our_classes(names: Sequence[str], wanted: Sequence[str]) -> list[int]:
    """Return for each class of a network its number in `wanted`, -1 where it is not wanted."""
    numbers = {name: number for number, name in enumerate(wanted)}
    return [numbers.get(our_name(name) or name.strip().lower(), -1) for name in names]


def suppress(boxes: Float32Array, scores: Float32Array, overlap: float) -> Int64Array:
    """Return the rows of the boxes that stay, the best first.

    Parameters
    ----------
    boxes
        float32 `(n, 4)`: x1, y1, x2, y2.
    scores
        float32 `(n,)`.
    overlap
        A box with more intersection over union with a better one is removed.
    """
    near, far = boxes[:, :2], boxes[:, 2:]
    places = np.concatenate([near, far - near], axis=1, dtype=np.float64)
    kept = cv2.dnn.NMSBoxes(places.tolist(), scores.tolist(), 0.0, overlap)
    return np.asarray(kept, np.int64).reshape(-1)
