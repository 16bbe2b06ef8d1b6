"""Readers of tracks, ground truth and labelled images in any format, and the roles of labels.

A labelled box is a vehicle, an ignore region, or neither: its role in evaluation and training.
"""

import gc
import logging
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import astuple, dataclass, replace
from pathlib import Path
from typing import Self

from vdet.boxes import Box
from vdet.config.classes import STANDARD_CLASSES, letters, standard_class
from vdet.config.schema import Role, Settings
from vdet.errors import TruthError, printable, quantity
from vdet.files import is_hidden
from vdet.labels.coco import read_coco_images
from vdet.labels.images import LabelledImage, LabelledImages, is_file, read_yolo_images
from vdet.labels.label import (
    NO_ID,
    Format,
    SavedTracks,
    Size,
    check_frames,
    line_error,
    mistake_in_box,
    read_bytes,
    recognize,
    track_formats,
)
from vdet.labels.lines import MOT
from vdet.track.track import Track

_IGNORED = ("tram", "train", "misc", "trailer", "caravan", "rider")
_REGIONS = ("ignore", "ignored", "ignore region", "ignored region", "ignored regions", "dont care")
_REGION_LETTERS = tuple(dict.fromkeys(map(letters, _REGIONS)))
_ANY_KIND = ("car", "truck", "bus")  # included in the class "vehicle" of a detector

_log = logging.getLogger("vdet")

_HEAD_LINES, _MAX_LINE = 3, 1_000_000
"""Number of lines of a head, and maximum bytes of each."""

_PERCENT = 100
"""If all boxes end below it, in images more than twice as large, they are probably percent."""
_SLACK = 0.1
"""How far a box may extend beyond a side of the image, as a fraction of it."""


def _key(word: str) -> str:
    """Return the class of a word, else its letters."""
    return standard_class(word) or letters(word)


@dataclass(frozen=True, slots=True)
class Roles:
    """The meaning of labels; case, spaces and punctuation do not matter.

    Attributes
    ----------
    words
        The role of each known word.
    classes
        The class by the letters of its name.
    """

    words: Mapping[str, Role]
    classes: Mapping[str, str]

    @classmethod
    def of(cls, roles: Mapping[str, Role], classes: Sequence[str]) -> Self:
        """Return the roles of words; a class without a role is a vehicle if it is in `classes`.

        Other known classes are ignored. A class in `classes` with the role "other" is also ignored:
        the detector finds it, so it is not background.
        """
        words: dict[str, Role] = dict.fromkeys((*STANDARD_CLASSES, *map(_key, _IGNORED)), "ignored")
        words.update(dict.fromkeys(map(_key, classes), "vehicle"))
        for word, role in roles.items():
            is_detected = words.get(_key(word)) == "vehicle"
            words[_key(word)] = "ignored" if is_detected and role == "other" else role
        words.update(dict.fromkeys(_REGION_LETTERS, "ignored"))
        return cls(words, {letters(name): name for name in classes})

    @classmethod
    def from_settings(cls, settings: Settings) -> Self:
        """Return the roles by `labels.roles` and the classes of the detector.

        The class "vehicle" includes cars, trucks and buses.
        """
        classes = settings.detector.vehicle_classes
        any_kind = _ANY_KIND if "vehicle" in classes else ()
        return cls.of(settings.labels.roles, (*classes, *any_kind))

    @classmethod
    def for_training(cls, settings: Settings) -> Self:
        """Return the roles by `labels.roles` and the classes that a network learns.

        Vehicles of unknown kind are learnt if the network learns cars, trucks or buses.
        """
        classes = settings.train.net.classes
        any_kind = () if set(_ANY_KIND).isdisjoint(classes) else ("vehicle",)
        return cls.of(settings.labels.roles, (*classes, *any_kind))

    def role_of(self, label: str) -> Role | None:
        """Return the role of a label; None if it is unknown."""
        return self.words.get(_key(label))

    def class_of(self, label: str) -> str | None:
        """Return the class of a label; None if it has none."""
        return self.classes.get(letters(label)) or standard_class(label)


DEFAULT_ROLES = Roles.from_settings(Settings())
"""The roles of the default settings."""


def read_tracks(path: Path, rate: float | None = None, size: Size | None = None) -> SavedTracks:
    """Read the tracks of a video from a file in any format; ignore regions are omitted.

    Tracks without a score have score 1. An empty `.txt` has no tracks.

    Parameters
    ----------
    rate
        Frames per second, for formats without times. None leaves their frames without times.
    size
        Width and height of the frames in which the tracks are used, pixels; None if unknown.

    Raises
    ------
    TruthError
        The file cannot be read, has a mistake, whose position the message names, or is of frames of
        another size.
    """
    data = read_bytes(path)
    was_enabled = gc.isenabled()
    gc.disable()  # labels have no cycles, and looking for some takes a quarter of the time
    try:
        saved = recognize(path, data).read(path, data)
        names = {track.class_name for track in saved.tracks}
        regions = {name for name in names if name and letters(name) in _REGION_LETTERS}
        frames = {}
        for index, tracks in saved.frames.items():
            vehicles = [
                x if 0 <= x.score <= 1 else replace(x, score=min(max(x.score, 0.0), 1.0))
                for x in tracks
                if not (x.ignored or x.class_name in regions)
            ]
            if vehicles:
                frames[index] = vehicles
        check_frames(path, frames)
        saved = replace(saved, frames=frames).from_first_frame()
    finally:
        if was_enabled:
            gc.enable()
    if saved.size and size and saved.size != size:
        (width, height), (expected_width, expected_height) = saved.size, size
        fault = f"is of {width}×{height} frames, not {expected_width}×{expected_height}"
        raise TruthError(f"{path}: {fault}")
    return saved if rate is None else saved.at_rate(rate)


def read_head(path: Path) -> SavedTracks:
    """Return the first frames of a file, and what they say of its video, from its first lines.

    It is empty if they say nothing, or are wrong: `read_tracks` says so.
    """
    lines: list[bytes] = []
    if path.is_file():  # else it can be read only once, or `read_tracks` says what is wrong
        with suppress(OSError), path.open("rb") as file:
            lines = [file.readline(_MAX_LINE) for _ in range(_HEAD_LINES)]
    with suppress(TruthError):
        form = recognize(path, b"".join(lines))
        if form.read_head:
            return form.read_head(path, b"".join(lines)).from_first_frame()
    return SavedTracks({})


def read_truth(path: Path, roles: Roles = DEFAULT_ROLES) -> SavedTracks:
    """Read the vehicles and ignore regions of a video from any format of tracks.

    Boxes without a label are vehicles. In MOTChallenge, flag 0 marks an ignore region, also in the
    older variant with ten columns. All boxes of `X_gt_ignore.txt` beside `X_gt.txt` or
    `X_gt_whole.txt`, as in UAVDT, are ignore regions. A truth without a vehicle gives a warning
    (logger "vdet").

    Parameters
    ----------
    roles
        Which labels are vehicles, ignore regions, or omitted.

    Raises
    ------
    TruthError
        The file cannot be read, is empty, or has a mistake; the message names its position.
    """
    data = read_bytes(path)
    if not data.strip():
        names = ", ".join(track_format.name for track_format in track_formats())
        raise TruthError(f"{path}: is empty; ground truth must be a file of {names}")
    form = recognize(path, data)
    saved = form.read(path, data)
    frames = {
        index: list(_with_roles(path, form, tracks, roles))
        for index, tracks in saved.frames.items()
    }
    regions = path.with_stem(re.sub(r"_gt(_whole)?$", "_gt_ignore", path.stem))
    if form is MOT and regions != path and regions.is_file():
        for index, tracks in form.read(regions, read_bytes(regions)).frames.items():
            ignored = (replace(track, id=NO_ID, ignored=True) for track in tracks)
            frames.setdefault(index, []).extend(ignored)
    saved = replace(saved, frames={index: tracks for index, tracks in frames.items() if tracks})
    check_frames(path, saved.frames)
    if saved.frames and all(track.ignored for track in saved.tracks):
        flags = "; column 7 is 0 in all lines" if form is MOT else ""
        _log.warning("%s: has no vehicle, only ignore regions%s", path, flags)
    return saved


def _with_roles(path: Path, form: Format, tracks: Iterable[Track], roles: Roles) -> Iterator[Track]:
    """Yield vehicles and ignore regions; the name of each is the class of its label."""
    for track in tracks:
        name = track.class_name
        role = "vehicle" if name is None else roles.role_of(name)
        if role is None:
            message = f"label {name!r:.40} is unknown; set its role in labels.roles"
            raise line_error(path, track.position, message)
        if role != "other":
            # In the older variant of MOTChallenge, the score is the flag.
            ignored = track.ignored or role == "ignored" or (form is MOT and track.score == 0)
            name = name and (roles.class_of(name) or "vehicle")
            yield replace(track, class_name=name, score=1.0, ignored=ignored)


def read_labelled_images(path: Path, roles: Roles = DEFAULT_ROLES) -> LabelledImages:
    """Read labelled images in any format.

    Parameters
    ----------
    path
        A COCO file, or a folder in one of the formats.
    roles
        Which labels are vehicles, and which are ignore regions; the others are omitted.

    Raises
    ------
    TruthError
        There is no labelled set, or it has a mistake; the message names its position.
    """
    return _checked_images(str(path), _images(path), roles)


def _checked_images(name: str, images: Iterable[LabelledImage], roles: Roles) -> LabelledImages:
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
        labels = {(x.box, x.class_name, x.ignored): x for x in image.labels}.values()
        boxes += len(labels)
        repeated += len(image.labels) - len(labels)
        absurd += sum(_is_absurd(label.box, image.size) for label in labels)
        farthest = max([farthest, *(max(astuple(label.box)) for label in labels)])
        smallest = min(smallest, *(image.size or (0,)))
        if image.path in checked:
            raise TruthError(f"{name}: has the image {printable(image.path.name)} twice")
        checked[image.path] = replace(
            image,
            labels=tuple(_image_labels(image, labels, roles, omitted, ignored)),
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


def _image_labels(
    image: LabelledImage,
    labels: Iterable[Track],
    roles: Roles,
    omitted: Counter[str],
    ignored: Counter[str],
) -> Iterator[Track]:
    """Yield the vehicles and ignore regions of an image, and count the other labels."""
    if not is_file(image.path):
        raise TruthError(f"{printable(str(image.path))}: not found, but {image.file} labels it")
    for label in labels:
        name = label.class_name or ""
        role = roles.role_of(name)
        if role not in ("vehicle", "ignored"):
            omitted[name] += 1
            continue
        if mistake := mistake_in_box(label.box):
            raise line_error(image.file, label.position, mistake)
        ignored.update([name] if role == "ignored" and not label.ignored else [])
        is_ignored = label.ignored or role == "ignored"
        yield replace(label, class_name=roles.class_of(name) or "vehicle", ignored=is_ignored)


def _images(path: Path) -> Iterable[LabelledImage]:
    images, labels = path / "images", path / "labels"
    if images.is_dir() and labels.is_dir():
        return read_yolo_images(images, labels)
    files = _coco_files(path)
    if len(files) == 1:
        return read_coco_images(files[0])
    if files:
        names = ", ".join(str(file.relative_to(path)) for file in files[:5])
        raise TruthError(f"{path}: contains several such files ({names}); pass the one with labels")
    raise TruthError(
        f"{path}: labelled images not found; use a folder with one .json file (COCO), or with "
        "images and labels (YOLO)"
    )


def _coco_files(path: Path) -> list[Path]:
    """Return the possible COCO files; only regular files, because a FIFO may never end."""
    if not path.is_dir():
        return [path] if path.suffix.lower() == ".json" and path.is_file() else []
    files = sorted(file for name in ("*.json", "annotations/*.json") for file in path.glob(name))
    return [file for file in files if file.is_file() and not is_hidden(file.relative_to(path))]
