"""Labelled images: their values, and the checks for every format."""

import logging
import math
import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import astuple, dataclass, field, replace
from pathlib import Path, PurePosixPath
from urllib.parse import unquote, unquote_plus

from vdet.boxes import Box, Image
from vdet.errors import ImageError, TruthError, printable, quantity
from vdet.labels.label import Label, Size, line_error, mistake_in_box
from vdet.labels.roles import DEFAULT_ROLES, Roles
from vdet.media.images import read_image

_PERCENT = 100
"""If all boxes end below it, in images more than twice as large, they are probably percent."""
_SLACK = 0.1
"""How far a box may extend beyond a side of the image, as a fraction of it."""

_log = logging.getLogger("vdet")


@dataclass(frozen=True, slots=True)
class LabelledImage:
    """An image with its labels.

    Attributes
    ----------
    path, file
        The image file, and the file of its labels.
    labels
        From a reader: all labels of the file. In `LabelledImages`: only vehicles and ignore
        regions, each with an area, named by a class of `Roles`.
    size
        Width and height of the image in pixels; None if the labels do not contain them.
    unlabelled
        Classes that are not labelled although the image may show them.
    """

    path: Path
    file: Path
    labels: tuple[Label, ...] = ()
    size: Size | None = None
    unlabelled: tuple[str, ...] = ()

    def read(self) -> Image:
        """Read the image, BGR uint8 `(H, W, 3)`.

        Raises
        ------
        ImageError
            It cannot be read, or its size differs from that in its labels.
        """
        image = read_image(self.path)
        height, width = image.shape[:2]
        if self.size not in (None, (width, height)):
            labelled = f"{self.size[0]}×{self.size[1]}"
            raise ImageError(f"{self.path}: is {width}×{height}, but its labels are for {labelled}")
        return image


@dataclass(frozen=True, slots=True)
class LabelledImages:
    """Labelled images of one source.

    `name` is shown in tables. `omitted` are labels that are neither vehicles nor ignore regions,
    whose boxes are omitted; `ignored` are the labels of ignore regions. Both have the number of
    boxes of each label, the most frequent first.
    """

    name: str
    images: tuple[LabelledImage, ...]
    omitted: Mapping[str, int] = field(default_factory=dict)
    ignored: Mapping[str, int] = field(default_factory=dict)


def checked_images(
    name: str, images: Iterable[LabelledImage], roles: Roles = DEFAULT_ROLES
) -> LabelledImages:
    """Check the labels of a set, and omit the labels that are not vehicles.

    A duplicate label in an image counts once, with a warning.

    Raises
    ------
    TruthError
        There is no image, an image is missing or appears twice, a box has no area, or most boxes
        cannot be pixels of their images.
    """
    checked: dict[Path, LabelledImage] = {}
    omitted, ignored = Counter[str](), Counter[str]()
    boxes = repeated = absurd = 0
    farthest, smallest = 0.0, math.inf
    for image in images:
        labels = tuple(
            {
                (label.track.box, label.track.class_name, label.ignored): label
                for label in image.labels
            }.values()
        )
        boxes += len(labels)
        repeated += len(image.labels) - len(labels)
        absurd += sum(_is_absurd(label.track.box, image.size) for label in labels)
        farthest = max([farthest, *(max(astuple(label.track.box)) for label in labels)])
        smallest = min(smallest, *(image.size or (0,)))
        if image.path in checked:
            raise TruthError(f"{name}: has the image {printable(image.path.name)} twice")
        checked[image.path] = replace(
            image,
            labels=tuple(_with_roles(replace(image, labels=labels), roles, omitted, ignored)),
            unlabelled=tuple(filter(None, map(roles.class_of, image.unlabelled))),
        )
    if not checked:
        raise TruthError(f"{name}: has no labelled images")
    if absurd > boxes / 2:
        raise TruthError(
            f"{name}: {absurd} of {quantity(boxes, 'box')} are outside their images or within a "
            "pixel; the numbers must be in the unit of the format"
        )
    if 0 < farthest <= _PERCENT < smallest / 2:
        _log.warning(
            "%s: no box reaches beyond pixel 100; if these are percent, convert them", name
        )
    if repeated:
        duplicates = quantity(repeated, "label")
        _log.warning("%s: has %s twice in the same image; each counts once", name, duplicates)
    return LabelledImages(
        name, tuple(checked.values()), dict(omitted.most_common()), dict(ignored.most_common())
    )


def _is_absurd(box: Box, size: Size | None) -> bool:
    """Return whether a box cannot be in pixels: it has fractions, or two corners for its size."""
    width, height = size or (math.inf, math.inf)
    slack_x, slack_y = _SLACK * width, _SLACK * height
    reaches_left = box.x1 < -slack_x or box.y1 < -slack_y
    reaches_right = box.x2 > width + slack_x or box.y2 > height + slack_y
    return reaches_left or reaches_right or max(box.x2, box.y2) <= 1


def _with_roles(
    image: LabelledImage, roles: Roles, omitted: Counter[str], ignored: Counter[str]
) -> Iterator[Label]:
    """Yield the vehicles and ignore regions of an image, and count the other labels."""
    if not is_file(image.path):
        raise TruthError(f"{printable(str(image.path))}: not found, but {image.file} labels it")
    for label in image.labels:
        name = label.track.class_name or ""
        role = roles.role_of(name)
        if role not in ("vehicle", "ignored"):
            omitted[name] += 1
            continue
        if mistake := mistake_in_box(label.track.box):
            raise line_error(image.file, label.position, mistake)
        ignored.update([name] if role == "ignored" and not label.ignored else [])
        is_ignored = label.ignored or role == "ignored"
        named = label.named(roles.class_of(name) or "vehicle")
        yield named._replace(ignored=is_ignored)


def is_file(path: Path) -> bool:
    """Return whether a file exists; False if its name is too long."""
    return os.path.isfile(path)  # noqa: PTH113  # the method of `Path` raises


def inside_set(name: str) -> str:
    """Return an image name from a file. Raises `ValueError` if it points outside the set."""
    if ".." in PurePosixPath(name.replace("\\", "/")).parts:
        raise ValueError(f"{printable(name)} points outside the set")
    return name


def image_names(path: Path, names: Sequence[str]) -> list[Path]:
    """Return the paths of the images that a file of labels names.

    If not all are found by these names, they may be addresses (`a%20b.jpg`, `a+b.jpg`), and then
    only their last parts are used, such as `a.jpg` of `/data/upload/1/a.jpg` or
    `/data/?d=images/a.jpg`; a backslash separates folders, too. Raises `TruthError` if no folder
    has the first image, or several have.
    """
    addresses = [name.rpartition("?d=")[2].partition("?")[0] for name in names]
    decoded = [list(map(decode, addresses)) for decode in (unquote, unquote_plus)]
    last_parts = [[re.split(r"[/\\]", name)[-1] for name in item] for item in (addresses, *decoded)]
    for spelled in (names, *decoded, *last_parts) if names else ():
        if len(set(spelled)) == len(set(names)):
            with suppress(TruthError):
                folder = image_folder(path, spelled)
                paths = [folder / name for name in spelled]
                if all(map(is_file, paths)):
                    return paths
    return [image_folder(path, names) / name for name in names]


def image_folder(path: Path, names: Sequence[str]) -> Path:
    """Return the folder that image names are relative to: the one that has the first image.

    It is the folder of the label file or at most two folders below; if the file is in
    `annotations`, below the parent folder. Raises `TruthError` if there is none or several, or a
    name is absolute or points outside the set.
    """
    if any(name.startswith("/") or ".." in PurePosixPath(name).parts for name in names):
        raise TruthError(f"{path}: has absolute names of images; make them relative")
    name = names[0]
    near, shown = path.parent, printable(name)
    above = near.parent if near.name == "annotations" else near
    for level in ([near], [above], sorted(above.glob("*/")), sorted(above.glob("*/*/"))):
        folders = [folder for folder in level if is_file(folder / name)]
        if len(folders) > 1:
            both = " and ".join(str(folder) for folder in folders[:2])
            raise TruthError(f"{path}: its first image, {shown}, is in {both}; keep one")
        if folders:
            return folders[0]
    raise TruthError(f"{path}: its first image, {shown}, was not found beside it or below")
