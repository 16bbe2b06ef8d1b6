"""A network in an ONNX file as a detector, of the kind `net`."""

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from vdet.boxes import Box, Boxes, Image, Int32Array, clipped
from vdet.config.schema import NetworkSettings
from vdet.detect.classes import our_name
from vdet.detect.factory import DetectorKind
from vdet.detect.onnx.layouts import RawBoxes
from vdet.detect.onnx.merging import combine, suppress
from vdet.detect.onnx.preparation import InputForm
from vdet.detect.onnx.recognition import Recognized, read_header, recognize
from vdet.detect.onnx.session import Session
from vdet.draw.boxes import GREEN, draw_box
from vdet.errors import ModelError
from vdet.media import Picture

_LARGER = 2.0
"""Pixels of the larger input for a single image, as a multiple of those for a frame of a video."""

Candidates = tuple[list[RawBoxes], InputForm, float]
"""The boxes of each search before suppression, the form of the first input, the minimum score."""

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
        larger = self._recognized.for_frames(width, height, _LARGER)
        return NetworkDetector(network, larger, self._numbers, self._settings)


@dataclass(frozen=True, slots=True, eq=False)
class NetworkDetector:
    """Finds vehicles in frames of one size: a `VideoDetector` without state.

    Our networks search a single image twice, the second time mirrored and with a larger input, as
    `larger`; for networks of other tools, `larger` is `network`. `numbers` has the index of each
    class of the network in `detector.classes`, -1 for other classes; its last entry, -1, stands for
    unknown classes.
    """

    network: Recognized
    larger: Recognized
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
        searches = [self._find(self.network, picture)]
        minimum = self.settings.min_score
        if index is None:
            minimum = max(minimum, self.settings.min_score_still)
            if self.larger is not self.network:
                mirrored = Picture(np.ascontiguousarray(picture.image[:, ::-1]))
                searches.append(self._find(self.larger, mirrored).mirrored(picture.width))
        return searches, self.network.form, minimum

    def _find(self, network: Recognized, picture: Picture) -> RawBoxes:
        """Return the boxes of the classes in the settings before suppression."""
        raw = network.find(picture, self.settings.min_score)
        boxes = clipped(raw.boxes.astype(np.float64), (picture.width, picture.height))
        is_known = (raw.classes >= 0) & (raw.classes < len(self.numbers))
        numbers = self.numbers[np.where(is_known, raw.classes, -1)]
        keep = (numbers >= 0) & (boxes[:, 2:] - boxes[:, :2] >= 1).all(axis=1)  # not with a NaN
        wanted = self.numbers[:-1, np.newaxis] == np.arange(len(self.settings.classes))
        likely = None if raw.class_scores is None else raw.class_scores[keep] @ wanted
        return RawBoxes(boxes[keep].astype(np.float32), raw.scores[keep], numbers[keep], likely)

    def detect(self, candidates: Candidates) -> Boxes:
        """Return one box for each vehicle."""
        searches, form, minimum = candidates
        overlap = self.settings.nms_iou
        found, *others = (suppress(raw, overlap) for raw in searches)
        for other in others:
            found = combine(found, other, overlap)
        found = found.rows(found.scores >= minimum)
        return Boxes(
            found.boxes,
            found.scores,
            classes=found.classes,
            names=self.settings.classes,
            data={} if found.class_scores is None else {"class_scores": found.class_scores},
            trace=(searches, form),
        )

    def stage_pictures(self, image: Image, detections: Boxes) -> dict[str, Image]:
        """Return images of the network's input, and of the boxes before suppression."""
        boxes = image.copy()
        searches, form = detections.trace
        for raw in searches:
            for box, score in zip(raw.boxes.round().astype(int).tolist(), raw.scores, strict=True):
                draw_box(boxes, Box(*box), GREEN, f"{score:.2f}")
        return {"input": form.scaled(Picture(image))[0], "candidates": boxes}


def our_classes(names: Sequence[str], wanted: Sequence[str]) -> list[int]:
    """Return the index in `wanted` of each class of a network, -1 if it is missing."""
    numbers = {name: number for number, name in enumerate(wanted)}
    return [numbers.get(our_name(name) or name.strip().lower(), -1) for name in names]


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
