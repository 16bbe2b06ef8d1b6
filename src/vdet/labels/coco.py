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
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import islice
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, BinaryIO

import ijson
from pydantic import AfterValidator, Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from vdet.errors import TruthError, printable
from vdet.files import record_input
from vdet.labels.documents import json_entries
from vdet.labels.formats import Format, SourceVideo, last_classes
from vdet.labels.label import MAX_LABELS, NO_ID, Label, Size, from_size, line_error
from vdet.labels.parsing import Index, Number, Times, checked_times, first_mistake
from vdet.labels.pictures import LabelledPicture, is_file
from vdet.labels.video import SavedTracks
from vdet.track.track import FrameTracks, State

_VIDEO = 1
"""Id of the only video."""

MAX_IMAGES = 1_000_000
"""Largest number of images in a file, and of categories."""

_MOST_NAMES = 1000

Opened = Callable[[], BinaryIO]
"""Opens the document, to read it from its beginning."""

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
                "attributes": {"occluded": track.state == "lost"},
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
    time: float | None = None
    labels: list[Label] = Field(default_factory=list, init=False)

    @property
    def size(self) -> Size | None:
        return (self.width, self.height) if self.width and self.height else None


_LISTS = {
    "images": TypeAdapter(_Image),
    "categories": TypeAdapter(_Category),
    "annotations": TypeAdapter(_Annotation),
}


def _entries(path: Path, opened: Opened, name: str) -> Iterator[Any]:
    """Yield the entries of a list. Raises `TruthError`."""
    for number, values in enumerate(json_entries(path, opened, name)):
        try:
            yield _LISTS[name].validate_python(values)
        except ValidationError as error:
            what = f"{name}.{number}: {first_mistake(error)}"
            raise TruthError(f"{path}: is not COCO: {what}") from error


def _read(path: Path, opened: Opened) -> list[_Image]:
    """Return the images with their labels. Raises `TruthError`."""
    images = {image.id: image for image in _distinct(path, opened, "images")}
    names = {category.id: category.name for category in _distinct(path, opened, "categories")}
    for number, entry in enumerate(_entries(path, opened, "annotations")):
        place = f"annotations.{number}"
        if number == MAX_LABELS:
            raise line_error(path, place, f"has more than {MAX_LABELS:,} boxes; cut it into parts")
        if entry.image_id not in images or entry.category_id not in names:
            what = f"image {entry.image_id} or category {entry.category_id} not found"
            raise line_error(path, place, what)
        image, box = images[entry.image_id], from_size(*entry.bbox)
        state: State = "lost" if (entry.attributes or {}).get("occluded") else "seen"
        id_, frame = NO_ID if entry.track_id is None else entry.track_id, image.frame_index or 0
        known = frame + 1, id_, entry.score, entry.iscrowd, state
        image.labels.append(Label(place, box, names[entry.category_id], *known))
    return list(images.values())


def _distinct(path: Path, opened: Opened, name: str) -> list[Any]:
    found = list(islice(_entries(path, opened, name), MAX_IMAGES + 1))
    if len(found) > MAX_IMAGES:
        raise TruthError(f"{path}: has more than {MAX_IMAGES:,} {name}; cut the file into parts")
    if len({entry.id for entry in found}) < len(found):
        raise TruthError(f"{path}: is not COCO: an id of {name} occurs twice")
    return found


def read_coco(path: Path, data: bytes) -> SavedTracks:
    """Read the boxes of one video; `iscrowd: 1` marks an ignore region.

    Raises
    ------
    TruthError
        The file is not of this form or too large, an id of images or categories or a frame occurs
        twice, a time is wrong, or an annotation names an image or a category that is not there.
    """
    images = _read(path, lambda: io.BytesIO(data))
    labels = tuple(label for image in images for label in image.labels)
    frames = [image.frame_index for image in images if image.frame_index is not None]
    if len(frames) < len(images) or any(label.id == NO_ID for label in labels):
        what = "needs the frame_index of each image and the track_id of each annotation"
        raise TruthError(f"{path}: {what}; CVAT has them in 'CVAT for video 1.1'")
    if len(set(frames)) < len(images):
        raise TruthError(f"{path}: a frame_index occurs twice; several videos need a file for each")
    times: Times = {
        frame: (f"images.{number}", image.time)
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
    folder, unlabelled = None, _unlabelled(path)
    for image in _read(path, lambda: path.open("rb")):
        folder = folder or _picture_folder(path, image.file_name)
        picture, labels = folder / image.file_name, tuple(image.labels)
        yield LabelledPicture(picture, path, labels, image.size, unlabelled)


def _unlabelled(path: Path) -> tuple[str, ...]:
    """Return the classes that the set does not label, although they may be there."""
    try:
        with path.open("rb") as file:
            record_input(file.fileno())
            names = list(islice(ijson.items(file, "info.unlabelled_classes.item"), _MOST_NAMES))
    except OSError as error:
        raise TruthError(f"{path}: cannot be read: {error.strerror}") from error
    except ijson.JSONError as error:
        raise TruthError(f"{path}: is not JSON: {error}") from error
    return tuple(map(str, names))


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
