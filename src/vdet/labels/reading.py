"""Readers of tracks, predictions, ground truth and labelled images in any format."""

import gc
import logging
import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from vdet.errors import TruthError
from vdet.files import is_hidden
from vdet.labels.coco import read_coco_images
from vdet.labels.formats import recognize, track_formats
from vdet.labels.images import LabelledImage, LabelledImages, checked_images
from vdet.labels.label import NO_ID, Label, SavedTracks, Size, checked_labels, line_error
from vdet.labels.lines import MOT
from vdet.labels.parsing import read_bytes
from vdet.labels.roles import DEFAULT_ROLES, Roles, is_region
from vdet.labels.yolo import read_yolo_images

_log = logging.getLogger("vdet")


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
        regions = set(filter(is_region, {label.track.class_name for label in saved.labels}))
        vehicles = [
            label if 0 <= label.track.score <= 1 else _with_score(label)
            for label in saved.labels
            if not (label.ignored or label.track.class_name in regions)
        ]
        saved = replace(saved, labels=checked_labels(path, vehicles)).from_first_frame()
    finally:
        if was_enabled:
            gc.enable()
    if saved.size and size and saved.size != size:
        (width, height), (expected_width, expected_height) = saved.size, size
        fault = f"is of {width}×{height} frames, not {expected_width}×{expected_height}"
        raise TruthError(f"{path}: {fault}")
    return saved if rate is None else saved.at_rate(rate)


def _with_score(label: Label) -> Label:
    """Return a label with the nearest score from 0 to 1."""
    return label.named(label.track.class_name, min(max(label.track.score, 0.0), 1.0))


_HEAD_LINES, _MAX_LINE = 3, 1_000_000
"""Number of lines of a head, and maximum bytes of each."""


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
    return SavedTracks(())


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
    labels: Iterable[Label] = saved.labels
    if form is MOT:  # in the older variant, the score is the flag
        labels = [
            label._replace(ignored=label.track.score == 0 or label.ignored) for label in labels
        ]
        regions = path.with_stem(re.sub(r"_gt(_whole)?$", "_gt_ignore", path.stem))
        if regions != path and regions.is_file():
            more = form.read(regions, read_bytes(regions)).labels
            labels += (Label(replace(x.track, id=NO_ID), x.position, x.frame, True) for x in more)
    checked = checked_labels(path, _with_roles(path, labels, roles))
    if checked and all(label.ignored for label in checked):
        flags = "; column 7 is 0 in all lines" if form is MOT else ""
        _log.warning("%s: has no vehicle, only ignore regions%s", path, flags)
    return replace(saved, labels=checked)


def _with_roles(path: Path, labels: Iterable[Label], roles: Roles) -> Iterator[Label]:
    """Yield vehicles and ignore regions; the name of each is the class of its label."""
    for label in labels:
        name = label.track.class_name
        role = "vehicle" if name is None else roles.role_of(name)
        if role is None:
            message = f"label {name!r:.40} is unknown; set its role in labels.roles"
            raise line_error(path, label.position, message)
        if role != "other":
            named = label.named(name and (roles.class_of(name) or "vehicle"), 1.0)
            yield named._replace(ignored=label.ignored or role == "ignored")


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
    return checked_images(str(path), _images(path), roles)


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
