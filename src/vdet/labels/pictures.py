"""Labelled pictures: the values, and the checks that apply to every form."""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vdet.boxes import BoolArray, Float64Array, Image
from vdet.errors import ImageError, TruthError, printable
from vdet.labels.label import MAX_IN_FRAME, Label, line_error, mistake_in_box
from vdet.labels.riders import merge_riders
from vdet.labels.roles import DEFAULT_ROLES, Roles
from vdet.media.images import is_picture_name, read_image

MAX_PICTURES = 200_000
"""Largest number of pictures in one set."""

MAX_BOXES = 2_000_000
"""Largest number of boxes in one set."""


@dataclass(frozen=True, slots=True)
class LabelledPicture:
    """A picture with its labels.

    Attributes
    ----------
    path, file
        The file of the picture, and the file of its labels.
    labels
        From a reader: all labels of the file. In `LabelledPictures`: only vehicles and ignore
        regions, each with an area; `name` is a class of `Roles`.
    size
        Width and height of the picture in pixels; None if the labels do not contain them.
    unlabelled
        Classes that have no label although they may be in the picture.
    """

    path: Path
    file: Path
    labels: tuple[Label, ...] = ()
    size: tuple[int, int] | None = None
    unlabelled: tuple[str, ...] = ()

    @property
    def boxes(self) -> Float64Array:
        """float64 `(n, 4)`: x1, y1, x2, y2 of each label, pixels from 0."""
        return np.array([label.box for label in self.labels], np.float64).reshape(-1, 4)

    @property
    def classes(self) -> tuple[str, ...]:
        """The name of each label."""
        return tuple(label.name or "" for label in self.labels)

    @property
    def ignored(self) -> BoolArray:
        """Bool `(n,)`: whether each label is an ignore region, not a vehicle to be found."""
        return np.array([label.ignored for label in self.labels], np.bool_)

    def read(self) -> Image:
        """Read the picture, BGR uint8 `(H, W, 3)`.

        Raises
        ------
        ImageError
            It cannot be read, or its size differs from that in its labels.
        """
        image = read_image(self.path)
        height, width = image.shape[:2]
        if self.size not in (None, (width, height)):
            raise ImageError(
                f"{self.path}: is {width}×{height}, its labels for {self.size[0]}×{self.size[1]}"
            )
        return image


@dataclass(frozen=True, slots=True)
class LabelledPictures:
    """Labelled pictures of one source.

    `name` is shown in tables. `others` are the labels that are neither vehicles nor ignore regions,
    whose boxes are left out, and `ignored` those that make a box an ignore region; each with the
    number of its boxes, the most frequent first.
    """

    name: str
    pictures: tuple[LabelledPicture, ...]
    others: tuple[tuple[str, int], ...] = ()
    ignored: tuple[tuple[str, int], ...] = ()


def checked_pictures(
    name: str, pictures: Iterable[LabelledPicture], roles: Roles = DEFAULT_ROLES
) -> LabelledPictures:
    """Check the labels of a set, and leave out the labels that are not vehicles.

    Raises
    ------
    TruthError
        There is no picture, a picture is missing or appears twice, a box has no area, or there are
        more than `MAX_PICTURES`, `MAX_BOXES` in all or `MAX_IN_FRAME` in one picture.
    """
    checked: dict[Path, LabelledPicture] = {}
    counts = Counter[str](), Counter[str]()
    boxes = 0
    for picture in pictures:
        boxes += len(picture.labels)
        if len(checked) == MAX_PICTURES or boxes > MAX_BOXES:
            raise TruthError(
                f"{name}: has more than {MAX_PICTURES:,} pictures or {MAX_BOXES:,} boxes; cut it"
            )
        if picture.path in checked:
            raise TruthError(f"{name}: has the picture {printable(picture.path.name)} twice")
        checked[picture.path] = replace(
            picture,
            labels=tuple(_with_roles(picture, roles, *counts)),
            unlabelled=tuple(filter(None, map(roles.class_of, picture.unlabelled))),
        )
    if not checked:
        raise TruthError(f"{name}: has no labelled picture")
    others, ignored = (tuple(each.most_common()) for each in counts)
    return LabelledPictures(name, tuple(checked.values()), others, ignored)


def _with_roles(
    picture: LabelledPicture, roles: Roles, others: Counter[str], ignored: Counter[str]
) -> Iterator[Label]:
    """Yield the vehicles and ignore regions of a picture, and count the labels of the others."""
    if not picture.path.is_file():
        raise TruthError(f"{picture.path}: is missing; its labels are there")
    count = 0
    for label in merge_riders(picture.labels):
        name = label.name or ""
        role = roles.role_of(name)
        if role not in ("vehicle", "ignored"):
            others[name] += 1
            continue
        mistake = mistake_in_box(label)
        if count == MAX_IN_FRAME:
            mistake = f"the picture has more than {MAX_IN_FRAME:,} boxes"
        if mistake:
            raise line_error(picture.file, label.place, mistake)
        count += 1
        ignored.update([name] if role == "ignored" and not label.ignored else [])
        is_ignored = label.ignored or role == "ignored"
        yield label._replace(name=roles.class_of(name) or "vehicle", ignored=is_ignored)


def pictures_below(folder: Path) -> list[Path]:
    """Return the pictures in a folder and in those below it, in order, without hidden files."""
    return sorted(filter(is_picture_name, folder.rglob("*")))


def labelled_pairs(labels: Path, suffix: str, pictures: Path) -> Iterator[tuple[Path, Path]]:
    """Yield each label file in a folder with the picture of its name.

    Raises
    ------
    TruthError
        A label file has no picture, or two.
    """
    by_name: dict[str, list[Path]] = {}
    for picture in pictures_below(pictures):
        by_name.setdefault(picture.stem, []).append(picture)
    for file in sorted(labels.glob(f"*{suffix}")):
        if file.name.startswith(".") or not file.is_file():  # a FIFO may never end
            continue
        found = by_name.get(file.stem, [])
        if len(found) != 1:
            what = "are two pictures" if found else "is no picture"
            raise TruthError(f"{file}: there {what} {printable(file.stem)} in {pictures}")
        yield file, found[0]
