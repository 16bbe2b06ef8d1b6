"""COCO: one JSON document for the tracks of a video or for a set of images.

For tracks there are `videos` and `tracks` in addition to the `images`, `annotations` and
`categories` of COCO. An image names its `video_id` and `frame_index`, an annotation its `track_id`.
All ids count from 1, frames and pixels from 0.

CVAT ("COCO 1.0") names the images of a video `frame_` and the number of the frame. It imports a
box only with a `segmentation`, and as one of a track only with `track_id` and `keyframe` in
`attributes`.
Source: Lin et al., "Microsoft COCO: Common Objects in Context", 2014; cocodataset.org, "Data
format"; Dave et al., "TAO: A Large-Scale Benchmark for Tracking Any Object", 2020; the source code
of CVAT, `dataset_manager/bindings.py`.
"""

import json
from codecs import BOM_UTF8
from collections.abc import Iterator, Sequence
from functools import partial
from math import nan
from pathlib import Path
from typing import Annotated, Any, BinaryIO, TypeVar

from pydantic import AfterValidator, AliasPath, FailFast, Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from vdet.boxes import Box
from vdet.config.classes import UNKNOWN
from vdet.errors import TruthError
from vdet.files import valid_text
from vdet.labels.images import LabelledImage, image_names, inside_set
from vdet.labels.label import (
    LIMIT,
    NO_ID,
    Format,
    Index,
    Number,
    SavedTracks,
    Size,
    SourceVideo,
    Times,
    checked_times,
    first_mistake,
    frame_number,
    last_classes,
    line_error,
    read_bytes,
)
from vdet.track.track import FrameTracks, Track

_VIDEO = 1
"""Id of the only video."""

_entry = partial(dataclass, frozen=True, slots=True, kw_only=True)

_Entry = TypeVar("_Entry")
_Entries = Annotated[list[_Entry], FailFast()]


class _Writer:
    """Collects a document, and writes each entry on its own line."""

    def __init__(self, *names: str) -> None:
        # Entries are kept as text, which is smaller than dictionaries.
        lists = *names, "annotations", "categories"
        self._lists: dict[str, list[str]] = {name: [] for name in lists}
        self._categories: dict[str, int] = {}

    def add(self, name: str, /, **entry: Any) -> None:
        """Add an entry to a list."""
        self._lists[name].append(json.dumps(entry))

    def add_box(self, image: int, box: Box, category: int, score: float, **more: Any) -> None:
        """Add an annotation; other programs ignore its `score` and `foot`."""
        x, y, width, height = box.xywh
        ids = {"id": len(self._lists["annotations"]) + 1, "image_id": image}
        sides = {"bbox": [x, y, width, height], "area": width * height, "segmentation": []}
        values = {"category_id": category, **sides, "iscrowd": 0, "score": round(score, 4)}
        self.add("annotations", **ids, **{**values, **more})

    def category(self, name: str) -> int:
        """Return the id of a category, and add it if it is new."""
        if name not in self._categories:
            self._categories[name] = len(self._categories) + 1
            self.add("categories", id=self._categories[name], name=name)
        return self._categories[name]

    def end(self, file: BinaryIO) -> None:
        """Write the document."""
        lists = (
            f'"{name}": [\n' + ",\n".join(texts) + "\n]" for name, texts in self._lists.items()
        )
        file.write(("{\n" + ",\n".join(lists) + "\n}\n").encode())


def _write(file: BinaryIO, video: SourceVideo, frames: Sequence[FrameTracks]) -> None:
    """Write the tracks of a video.

    Images have a `time` in seconds, which other programs ignore. Predicted boxes are `occluded`.
    """
    size = {"width": video.width, "height": video.height}
    classes, writer = last_classes(frames), _Writer("videos", "images", "tracks")
    writer.add("videos", id=_VIDEO, name=video.name, **size, vdet=video.record())
    for number, frame in enumerate(frames, start=1):
        name, time = f"frame_{frame.index:06}.png", round(frame.time, 6)
        image = {"id": number, "video_id": _VIDEO, "frame_index": frame.index, "file_name": name}
        writer.add("images", **image, **size, time=time)
        for track in frame.tracks:
            category = writer.category(classes[track.id])
            occluded = track.state == "predicted"
            attributes = {"occluded": occluded, "track_id": track.id, "keyframe": True}
            foot = list(track.written_foot)
            more = {"track_id": track.id, "foot": foot, "attributes": attributes}
            writer.add_box(number, track.box, category, track.score, **more)
    for id_, name in classes.items():
        writer.add("tracks", id=id_, video_id=_VIDEO, category_id=writer.category(name))
    writer.end(file)


def write_coco_images(file: BinaryIO, images: Sequence[LabelledImage]) -> None:
    """Write the vehicles in images of known sizes, whose paths are their names in the file."""
    writer = _Writer("images")
    for number, image in enumerate(images, start=1):
        assert image.size
        (width, height), name = image.size, valid_text(image.path.as_posix())
        writer.add("images", id=number, file_name=name, width=width, height=height)
        for track in image.labels:
            category = writer.category(track.class_name or UNKNOWN)
            writer.add_box(number, track.box, category, track.score)
    writer.end(file)


@_entry
class _Category:
    id: int
    name: str


@_entry
class _Annotation:
    image_id: int
    category_id: int
    bbox: tuple[Number, Number, Number, Number]
    iscrowd: bool = False
    track_id: Index | None = None
    score: Number = 1.0
    foot: tuple[Number, Number] | None = None
    attributes: dict[str, Any] | None = None
    """CVAT has `track_id` and `occluded` there, other programs have values of their own."""

    def track(self, position: str, name: str) -> Track:
        """Return the box with this name; `NO_ID` without a track."""
        attributes = self.attributes or {}
        id_ = attributes.get("track_id") if self.track_id is None else self.track_id
        x, y, width, height = self.bbox
        return Track(
            id_ if isinstance(id_, int) and 0 <= id_ <= LIMIT else NO_ID,
            Box.sized(x, y, width, height),
            self.score,
            "predicted" if attributes.get("occluded") else "detected",
            name,
            self.foot,
            position=position,
            ignored=self.iscrowd,
        )


@_entry
class _Image:
    id: int
    width: Index | None = None
    height: Index | None = None
    file_name: Annotated[str, AfterValidator(inside_set)] = ""
    frame_index: Index | None = None
    time: float | str | None = None  # "night" in some sets of images

    @property
    def frame(self) -> int | None:
        """Number of the frame, from 0; CVAT has it only in the name. None if it is unknown."""
        if self.frame_index is None and Path(self.file_name).name.startswith("frame_"):
            return frame_number(self.file_name)
        return self.frame_index

    @property
    def size(self) -> Size | None:
        """Width and height; None if a side is missing or 0, as some tools write."""
        return (self.width, self.height) if self.width and self.height else None


@_entry
class _CocoDocument:
    images: _Entries[_Image]
    categories: _Entries[_Category] = Field(default_factory=list)
    annotations: _Entries[_Annotation] = Field(default_factory=list)
    video: SourceVideo | None = Field(None, validation_alias=AliasPath("videos", 0, "vdet"))
    """A key of our own."""
    unlabelled: tuple[str, ...] = Field(
        (), validation_alias=AliasPath("info", "unlabelled_classes")
    )
    """A key of our own: classes that the images may show without a label."""


_DOCUMENT = TypeAdapter(_CocoDocument)


def _read(path: Path, data: bytes) -> _CocoDocument:
    """Return the document. Raises `TruthError`."""
    try:
        document = _DOCUMENT.validate_json(data.removeprefix(BOM_UTF8))
    except ValidationError as error:
        raise TruthError(f"{path}: is not COCO: {first_mistake(error)}") from error
    for entries in (document.images, document.categories):
        if len({entry.id for entry in entries}) < len(entries):
            raise TruthError(f"{path}: is not COCO: an id of images or categories occurs twice")
    return document


def _by_image(path: Path, document: _CocoDocument) -> dict[int, list[Track]]:
    """Return the boxes of each image by its id.

    Raises `TruthError` if an annotation refers to a missing image or category.
    """
    names = {category.id: category.name for category in document.categories}
    boxes: dict[int, list[Track]] = {image.id: [] for image in document.images}
    for number, entry in enumerate(document.annotations):
        position = f"annotations.{number}"
        if entry.image_id not in boxes or entry.category_id not in names:
            message = f"image {entry.image_id} or category {entry.category_id} not found"
            raise line_error(path, position, message)
        boxes[entry.image_id].append(entry.track(position, names[entry.category_id]))
    return boxes


def read_coco(path: Path, data: bytes) -> SavedTracks:
    """Read the boxes of one video; `iscrowd: 1` marks an ignore region.

    Raises
    ------
    TruthError
        The file is not in this format, an id of images or categories or a frame
        occurs twice, a time is wrong, or an annotation refers to a missing image or category.
    """
    document = _read(path, data)
    images = {image.frame: image for image in document.images if image.frame is not None}
    boxes = _by_image(path, document)
    ids = {track.id for tracks in boxes.values() for track in tracks}
    if any(image.frame is None for image in document.images) or NO_ID in ids:
        raise TruthError(
            f"{path}: needs the frame_index of each image and the track_id of each annotation; in "
            "CVAT, draw each box as a track"
        )
    if len(images) < len(document.images):
        raise TruthError(f"{path}: a frame_index occurs twice; use one file for each video")
    times: Times = {
        frame: (f"images.{number}", nan if isinstance(image.time, str) else image.time)
        for number, (frame, image) in enumerate(images.items())
        if image.time is not None
    }
    size = document.images[0].size if images else None
    frames = {frame: boxes[image.id] for frame, image in images.items() if boxes[image.id]}
    saved = SavedTracks(frames, tuple(sorted(images)), checked_times(path, times), size)
    return saved.of_video(document.video) if document.video else saved


def _read_head(path: Path, data: bytes) -> SavedTracks:
    """Read what `_write` puts first: the video."""
    return read_coco(path, data.rstrip() + b'], "images": []}')


COCO = Format("COCO", ".coco.json", read_coco, write_video=_write, read_head=_read_head)


def read_coco_images(path: Path) -> Iterator[LabelledImage]:
    """Yield every image of a COCO file; `iscrowd: 1` marks an ignore region.

    `image_names` finds the images, such as in `images/default` from CVAT. Only boxes and categories
    are used.

    Raises
    ------
    TruthError
        The file is not in this format, an annotation refers to a missing image or category, an id
        occurs twice, or an image is outside the set.
    """
    document = _read(path, read_bytes(path))
    boxes = _by_image(path, document)
    names = image_names(path, [image.file_name for image in document.images])
    for image, name in zip(document.images, names, strict=True):
        yield LabelledImage(
            path=name,
            file=path,
            labels=tuple(boxes[image.id]),
            size=image.size,
            unlabelled=document.unlabelled,
        )
