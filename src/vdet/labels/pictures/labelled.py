"""Pictures with the true boxes of their vehicles, and the checks of what label files say."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vdet.boxes import BoolArray, Float64Array
from vdet.errors import ImageError, TruthError
from vdet.files import printable
from vdet.labels.roles import class_of
from vdet.labels.rows import MAX_IN_FRAME, MAX_ROWS
from vdet.media.images import Image, read_image

MAX_IMAGES = 100_000
"""Most pictures in one set."""


@dataclass(frozen=True, slots=True)
class Label:
    """A box as it stands in a file.

    `place` is where it stands, `name` its label; `x`, `y`, `width` and `height` are pixels of the
    picture from 0. `ignored` makes an ignore region of a vehicle.
    """

    place: str
    name: str
    x: float
    y: float
    width: float
    height: float
    ignored: bool = False


@dataclass(frozen=True, slots=True)
class ImageLabels:
    """A picture and the boxes that a file gives it; `size` is its width and height, if known."""

    path: Path
    labels: tuple[Label, ...]
    size: tuple[int, int] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class LabelledImage:
    """A picture with the true boxes of its vehicles.

    Attributes
    ----------
    path
        The file of the picture.
    boxes
        float64 `(n, 4)`: x, y, width, height in pixels from 0, each with an area.
    classes
        What each is, one of `OUR_NAMES`.
    ignored
        bool `(n,)`: the row is an ignore region, not a vehicle to be found.
    size
        Width and height of the picture in pixels; None if the labels do not say.
    """

    path: Path
    boxes: Float64Array
    classes: tuple[str, ...]
    ignored: BoolArray
    size: tuple[int, int] | None = None

    def read(self) -> Image:
        """Read the picture, BGR uint8 `(H, W, 3)`.

        Raises
        ------
        ImageError
            It cannot be read, or has not the size that its labels were made for.
        """
        image = read_image(self.path)
        height, width = image.shape[:2]
        if self.size not in (None, (width, height)):
            raise ImageError(
                f"{self.path}: has {width}×{height} pixels, and its labels are for "
                f"{self.size[0]}×{self.size[1]}; take the picture that was labelled"
            )
        return image


@dataclass(frozen=True, slots=True, eq=False)
class LabelledImages:
    """Labelled pictures of one source.

    `name` stands in tables. `others` are the labels that are neither vehicles nor ignore regions,
    each with the number of its boxes, the most frequent first; these boxes are left out.
    """

    name: str
    images: tuple[LabelledImage, ...]
    others: tuple[tuple[str, int], ...] = ()


def checked_images(name: str, entries: Iterable[ImageLabels]) -> LabelledImages:
    """Check what the label files of a set say, and leave out what is no vehicle.

    Raises
    ------
    TruthError
        There is no picture, a picture is missing or comes twice, a box has no area, or there are
        more than `MAX_IMAGES`, `MAX_ROWS` boxes in all or `MAX_IN_FRAME` in one picture.
    """
    images: dict[Path, LabelledImage] = {}
    others: Counter[str] = Counter()
    boxes = 0
    for entry in entries:
        boxes += len(entry.labels)
        if len(images) == MAX_IMAGES or boxes > MAX_ROWS:
            raise TruthError(
                f"{name}: has more than {MAX_IMAGES:,} pictures or {MAX_ROWS:,} boxes; cut it into "
                "parts"
            )
        if entry.path in images:
            raise TruthError(f"{name}: has the picture {printable(entry.path.name)} twice")
        images[entry.path] = _checked_image(entry)
        others.update(label.name for label in entry.labels if class_of(label.name) is None)
    if not images:
        raise TruthError(f"{name}: has no labelled picture")
    return LabelledImages(name, tuple(images.values()), tuple(others.most_common()))


def _checked_image(entry: ImageLabels) -> LabelledImage:
    if not entry.path.is_file():
        raise TruthError(f"{entry.path}: is missing; its labels are there")
    rows: list[tuple[float, float, float, float]] = []
    classes: list[str] = []
    ignored: list[bool] = []
    for label in entry.labels:
        meaning = class_of(label.name)
        if meaning is None:
            continue
        if label.width <= 0 or label.height <= 0 or label.width * label.height <= 0:
            raise TruthError(
                f"{label.place}: the box has no area: {label.width:g} wide, {label.height:g} high"
            )
        if len(rows) == MAX_IN_FRAME:
            raise TruthError(f"{label.place}: the picture has more than {MAX_IN_FRAME:,} boxes")
        rows.append((label.x, label.y, label.width, label.height))
        classes.append(meaning[0])
        ignored.append(label.ignored or meaning[1])
    return LabelledImage(
        entry.path,
        np.array(rows, np.float64).reshape(-1, 4),
        tuple(classes),
        np.array(ignored, np.bool_),
        entry.size,
    )
