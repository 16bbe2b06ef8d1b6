"""COCO: one JSON document, of the tracks of a video or of a set of pictures.

For tracks there are `videos` and `tracks` beside the `images`, `annotations` and `categories` of
COCO. An image names its `video_id` and `frame_index`, an annotation its `track_id`. All ids count
from 1, frames and pixels from 0.
Source: Lin et al., "Microsoft COCO: Common Objects in Context", 2014; cocodataset.org, "Data
format"; Dave et al., "TAO: A Large-Scale Benchmark for Tracking Any Object", 2020.
"""

import io
import json
from collections import defaultdict
from collections.abc import Iterator, Sequence
from functools import partial
from math import nan
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, BinaryIO

from pydantic import AfterValidator, Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from vdet.errors import TruthError, printable
from vdet.files import record_input
from vdet.labels.documents import json_values
from vdet.labels.formats import Format, SourceVideo, last_classes
from vdet.labels.label import MAX_LABELS, NO_ID, Label, SavedTracks, Size, from_size, line_error
from vdet.labels.parsing import Index, Number, Times, checked_times, first_mistake
from vdet.labels.pictures import LabelledPicture, is_file
from vdet.track.track import FrameTracks, State

_VIDEO = 1
"""Id of the only video."""

_ANNOTATIONS = "annotations"  # the folder of label files in the COCO set itself


def _write(file: BinaryIO, video: SourceVideo, frames: Sequence[FrameTracks]) -> None:
    """Write all images and annotations, each on its line.

    An annotation has a `score`, and an image its `time` in seconds, which other programs ignore.
    `attributes.occluded` says that the vehicle is lost.
    """
    size = {"width": video.width, "height": video.height}
    classes = last_classes(frames)
    categories: dict[str, int] = defaultdict(lambda: len(categories) + 1)  # the id of each name
    lists: dict[str, list[str]] = {  # entries as text, which is smaller than dictionaries
        "videos": [json.dumps({"id": _VIDEO, "name": video.name, **size})],
        **{name: [] for name in ("images", "tracks", "annotations")},
    }
    for number, frame in enumerate(frames, start=1):
        name = f"frame_{frame.index:06}.png"
        image = {"id": number, "video_id": _VIDEO, "frame_index": frame.index, "file_name": name}
        lists["images"].append(json.dumps({**image, **size, "time": round(frame.time, 6)}))
        for track in frame.tracks:
            x, y, width, height = track.box.xywh
            annotation = {
                "id": len(lists["annotations"]) + 1,
                "image_id": number,
                "category_id": categories[classes[track.id]],
                "track_id": track.id,
                "bbox": [x, y, width, height],
                "area": width * height,
                "iscrowd": 0,
                "score": round(track.score, 4),
                "attributes": {"occluded": track.state == "predicted"},
            }
            lists["annotations"].append(json.dumps(annotation))
    for id_, name in classes.items():
        entry = {"id": id_, "video_id": _VIDEO, "category_id": categories[name]}
        lists["tracks"].append(json.dumps(entry))
    lists["categories"] = [json.dumps({"id": n, "name": name}) for name, n in categories.items()]
    parts = (f'"{name}": [\n' + ",\n".join(items) + "\n]" for name, items in lists.items())
    file.write(("{\n" + ",\n".join(parts) + "\n}\n").encode())


def _inside(name: str) -> str:
    """Refuse the name of a picture that leads out of the set."""
    if PurePosixPath(name).is_absolute() or ".." in PurePosixPath(name).parts:
        raise ValueError(f"{printable(name)} leads out of the set")
    return name


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


@_entry
class _Image:
    id: int
    width: Index | None = None
    height: Index | None = None
    file_name: Annotated[str, AfterValidator(_inside)] = ""
    frame_index: Index | None = None
    time: float | str | None = None  # "night" in some sets of pictures
    labels: list[Label] = Field(default_factory=list, init=False)

    @property
    def size(self) -> Size | None:
        return (self.width, self.height) if self.width and self.height else None


_LISTS: dict[str, TypeAdapter[Any]] = {
    "images": TypeAdapter(_Image),
    "categories": TypeAdapter(_Category),
    "annotations": TypeAdapter(_Annotation),
}


_UNLABELLED = "info.unlabelled_classes"  # of our own: they may be there without a label


def _read(path: Path, file: BinaryIO) -> tuple[list[_Image], tuple[str, ...]]:
    """Return the images with their labels, and classes without labels. Raises `TruthError`."""
    found: dict[str, list[Any]] = {name: [] for name in (*_LISTS, _UNLABELLED)}
    for place, values in json_values(path, file, *(f"{name}.item" for name in found)):
        name = place.removesuffix(".item")
        entries = found[name]
        if len(entries) == MAX_LABELS:
            raise TruthError(f"{path}: has more than {MAX_LABELS:,} {name}; cut it into parts")
        try:
            entries.append(_LISTS[name].validate_python(values) if name in _LISTS else str(values))
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
        id_, frame = NO_ID if entry.track_id is None else entry.track_id, image.frame_index or 0
        known = frame + 1, id_, entry.score, entry.iscrowd, state
        image.labels.append(Label(place, box, names[entry.category_id], *known))
    return images, tuple(unlabelled)


def read_coco(path: Path, data: bytes) -> SavedTracks:
    """Read the boxes of one video; `iscrowd: 1` marks an ignore region.

    Raises
    ------
    TruthError
        The file is not of this form or too large, an id of images or categories or a frame occurs
        twice, a time is wrong, or an annotation names an image or a category that is not there.
    """
    images, _ = _read(path, io.BytesIO(data))
    labels = tuple(label for image in images for label in image.labels)
    frames = [image.frame_index for image in images if image.frame_index is not None]
    if len(frames) < len(images) or any(label.id == NO_ID for label in labels):
        what = "needs the frame_index of each image and the track_id of each annotation"
        raise TruthError(f"{path}: {what}; CVAT has them in 'CVAT for video 1.1'")
    if len(set(frames)) < len(images):
        raise TruthError(f"{path}: a frame_index occurs twice; several videos need a file for each")
    times: Times = {
        frame: (f"images.{number}", nan if isinstance(image.time, str) else image.time)
        for number, (frame, image) in enumerate(zip(frames, images, strict=True))
        if image.time is not None
    }
    size = images[0].size if images else None
    return SavedTracks(labels, tuple(sorted(frames)), checked_times(path, times), size)


COCO = Format("COCO", ".coco.json", read_coco, whole=_write)


def read_coco_pictures(path: Path) -> Iterator[LabelledPicture]:
    """Yield every picture of a COCO file; `iscrowd: 1` marks an ignore region.

    Pictures lie beside the file or at most two folders below, as in `images/default` of CVAT; if
    the file is in `annotations`, beside or below that folder. Only boxes and categories are used.

    Raises
    ------
    TruthError
        The file is not of this form, an annotation names a picture or a category that is not
        there, an id occurs twice, or a picture lies outside.
    """
    folder = None
    try:
        with path.open("rb") as file:
            record_input(file.fileno())
            images, unlabelled = _read(path, file)
    except OSError as error:
        raise TruthError(f"{path}: cannot be read: {error.strerror}") from error
    for image in images:
        folder = folder or _picture_folder(path, image.file_name)
        picture, labels = folder / image.file_name, tuple(image.labels)
        yield LabelledPicture(picture, path, labels, image.size, unlabelled)


def _picture_folder(path: Path, name: str) -> Path:
    """Return the folder that the names of pictures are relative to: the one with the first."""
    near, shown = path.parent, printable(name)
    above = near.parent if near.name == _ANNOTATIONS else near
    for level in ([near], [above], sorted(above.glob("*/")), sorted(above.glob("*/*/"))):
        found = [folder for folder in level if is_file(folder / name)]
        if len(found) > 1:
            where = " and ".join(str(folder) for folder in found[:2])
            raise TruthError(f"{path}: its first picture, {shown}, lies in {where}; keep one")
        if found:
            return found[0]
    raise TruthError(f"{path}: its first picture, {shown}, is missing beside it and below")
