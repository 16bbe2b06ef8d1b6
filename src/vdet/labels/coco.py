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

import io
import json
from collections.abc import Iterator, Sequence
from functools import partial
from math import nan
from pathlib import Path
from typing import Annotated, Any, BinaryIO

from pydantic import AfterValidator, Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from vdet.boxes import Box
from vdet.detect.classes import UNKNOWN
from vdet.errors import TruthError
from vdet.labels.formats import Format, ImageTracks, SourceVideo, last_classes
from vdet.labels.images import LabelledImage, image_folder, inside
from vdet.labels.json_stream import json_values
from vdet.labels.label import MAX_LABELS, NO_ID, Label, SavedTracks, Size, from_size, line_error
from vdet.labels.parsing import (
    LIMIT,
    Index,
    Number,
    Times,
    checked_times,
    first_mistake,
    frame_number,
)
from vdet.track.track import FrameTracks, State

_VIDEO = 1
"""Id of the only video."""


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
        """Add an annotation; other programs ignore its `score`."""
        x, y, width, height = box.xywh
        whose = {"id": len(self._lists["annotations"]) + 1, "image_id": image}
        sides = {"bbox": [x, y, width, height], "area": width * height, "segmentation": []}
        known = {"category_id": category, **sides, "iscrowd": 0, "score": round(score, 4)}
        self.add("annotations", **whose, **known, **more)

    def category(self, name: str) -> int:
        """Return the id of a category, and add it if it is new."""
        if name not in self._categories:
            self._categories[name] = len(self._categories) + 1
            self.add("categories", id=self._categories[name], name=name)
        return self._categories[name]

    def end(self, file: BinaryIO) -> None:
        """Write the document."""
        parts = (f'"{name}": [\n' + ",\n".join(some) + "\n]" for name, some in self._lists.items())
        file.write(("{\n" + ",\n".join(parts) + "\n}\n").encode())


def _write(file: BinaryIO, video: SourceVideo, frames: Sequence[FrameTracks]) -> None:
    """Write the tracks of a video.

    Images have a `time` in seconds, which other programs ignore. Predicted boxes are `occluded`.
    """
    size = {"width": video.width, "height": video.height}
    classes, writer = last_classes(frames), _Writer("videos", "images", "tracks")
    writer.add("videos", id=_VIDEO, name=video.name, **size)
    for number, frame in enumerate(frames, start=1):
        name, time = f"frame_{frame.index:06}.png", round(frame.time, 6)
        image = {"id": number, "video_id": _VIDEO, "frame_index": frame.index, "file_name": name}
        writer.add("images", **image, **size, time=time)
        for track in frame.tracks:
            category = writer.category(classes[track.id])
            occluded = track.state == "predicted"
            attributes = {"occluded": occluded, "track_id": track.id, "keyframe": True}
            more = {"track_id": track.id, "attributes": attributes}
            writer.add_box(number, track.box, category, track.score, **more)
    for id_, name in classes.items():
        writer.add("tracks", id=id_, video_id=_VIDEO, category_id=writer.category(name))
    writer.end(file)


def _write_images(file: BinaryIO, images: Sequence[ImageTracks]) -> None:
    writer = _Writer("images")
    for number, image in enumerate(images, start=1):
        (width, height), name = image.size, image.path.as_posix()
        writer.add("images", id=number, file_name=name, width=width, height=height)
        for track in image.tracks:
            category = writer.category(track.class_name or UNKNOWN)
            writer.add_box(number, track.box, category, track.score)
    writer.end(file)


_entry = partial(dataclass, frozen=True, slots=True, kw_only=True)


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
    attributes: dict[str, Any] | None = None

    @property
    def track(self) -> int:
        """Id of the track, which CVAT has in `attributes`; `NO_ID` without one."""
        own = (self.attributes or {}).get("track_id") if self.track_id is None else self.track_id
        return own if isinstance(own, int) and 0 <= own <= LIMIT else NO_ID


@_entry
class _Image:
    id: int
    width: Index | None = None
    height: Index | None = None
    file_name: Annotated[str, AfterValidator(inside)] = ""
    frame_index: Index | None = None
    time: float | str | None = None  # "night" in some sets of images
    labels: list[Label] = Field(default_factory=list, init=False)

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


_LISTS: dict[str, TypeAdapter[Any]] = {
    "images": TypeAdapter(_Image),
    "categories": TypeAdapter(_Category),
    "annotations": TypeAdapter(_Annotation),
    "info.unlabelled_classes": TypeAdapter(str),  # of our own: they may be there without a label
}


def _read(path: Path, file: BinaryIO) -> tuple[list[_Image], tuple[str, ...]]:
    """Return the images with their labels, and classes without labels. Raises `TruthError`."""
    found: dict[str, list[Any]] = {name: [] for name in _LISTS}
    for place, values in json_values(path, file, *(f"{name}.item" for name in found)):
        name = place.removesuffix(".item")
        entries = found[name]
        if len(entries) == MAX_LABELS:
            raise TruthError(f"{path}: has more than {MAX_LABELS:,} {name}; cut it into parts")
        try:
            entries.append(_LISTS[name].validate_python(values))
        except ValidationError as error:
            entry = f"{name}.{len(entries)}" + (": ", ".")[bool(error.errors()[0]["loc"])]
            raise TruthError(f"{path}: is not COCO: {entry}{first_mistake(error)}") from error
    images, categories, annotations, unlabelled = found.values()
    by_id = {image.id: image for image in images}
    names = {category.id: category.name for category in categories}
    if len(by_id) < len(images) or len(names) < len(categories):
        raise TruthError(f"{path}: is not COCO: an id of images or categories occurs twice")
    for number, entry in enumerate(annotations):
        place = f"annotations.{number}"
        if entry.image_id not in by_id or entry.category_id not in names:
            what = f"image {entry.image_id} or category {entry.category_id} not found"
            raise line_error(path, place, what)
        image, box = by_id[entry.image_id], from_size(*entry.bbox)
        state: State = "predicted" if (entry.attributes or {}).get("occluded") else "detected"
        known = entry.track, entry.score, entry.iscrowd, state
        image.labels.append(Label(place, box, names[entry.category_id], 1, *known))
    return images, tuple(unlabelled)


def read_coco(path: Path, data: bytes) -> SavedTracks:
    """Read the boxes of one video; `iscrowd: 1` marks an ignore region.

    Raises
    ------
    TruthError
        The file is not in this format or is too large, an id of images or categories or a frame
        occurs twice, a time is wrong, or an annotation refers to a missing image or category.
    """
    images, _ = _read(path, io.BytesIO(data))
    frames = {image.frame: image for image in images if image.frame is not None}
    ids = (label.id for image in images for label in image.labels)
    if any(image.frame is None for image in images) or NO_ID in ids:
        what = "needs the frame_index of each image and the track_id of each annotation"
        raise TruthError(f"{path}: {what}; in CVAT, draw each box as a track")
    if len(frames) < len(images):
        raise TruthError(f"{path}: a frame_index occurs twice; use one file for each video")
    times: Times = {
        frame: (f"images.{number}", nan if isinstance(image.time, str) else image.time)
        for number, (frame, image) in enumerate(frames.items())
        if image.time is not None
    }
    labels = tuple(
        label._replace(frame=frame + 1) for frame, image in frames.items() for label in image.labels
    )
    size = images[0].size if images else None
    return SavedTracks(labels, tuple(sorted(frames)), checked_times(path, times), size)


COCO = Format("COCO", ".coco.json", read_coco, whole=_write, images=_write_images)


def read_coco_images(path: Path) -> Iterator[LabelledImage]:
    """Yield every image of a COCO file; `iscrowd: 1` marks an ignore region.

    `image_folder` finds the images, such as in `images/default` from CVAT. Only boxes and
    categories are used.

    Raises
    ------
    TruthError
        The file is not in this format, an annotation refers to a missing image or category, an id
        occurs twice, or an image is outside the set.
    """
    folder = None
    try:
        with path.open("rb") as file:
            images, unlabelled = _read(path, file)
    except OSError as error:
        raise TruthError(f"{path}: cannot be read: {error.strerror}") from error
    for image in images:
        folder = folder or image_folder(path, image.file_name)
        place, labels = folder / image.file_name, tuple(image.labels)
        yield LabelledImage(place, path, labels, image.size, unlabelled)
