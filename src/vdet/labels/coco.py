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
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, BinaryIO

from pydantic import AfterValidator, Field, TypeAdapter
from pydantic.dataclasses import dataclass

from vdet.errors import TruthError, printable
from vdet.files import record_input
from vdet.labels.formats import Format, SourceVideo, last_classes
from vdet.labels.json_stream import JsonLists
from vdet.labels.label import Label, from_size, limited, line_error
from vdet.labels.parsing import LIMIT, Index, Number, Times, checked_times
from vdet.labels.pictures import MAX_BOXES, MAX_PICTURES, LabelledPicture
from vdet.labels.video import SavedTracks
from vdet.track.track import FrameTracks, State

_VIDEO = 1
"""Id of the only video."""

_ANNOTATIONS = "annotations"  # the folder of label files in the COCO set itself
_MAX_NAME = 255  # bytes, as in most file systems


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


_Id = Annotated[int, Field(ge=-LIMIT, le=LIMIT)]
_Side = Annotated[int, Field(ge=1, le=LIMIT)]


def _inside(name: str) -> str:
    """Refuse the name of a picture that leads out of the set or cannot be a file name."""
    inside = PurePosixPath(name)
    if inside.is_absolute() or ".." in inside.parts:
        raise ValueError(f"{printable(name)} leads out of the set")
    if not name.isprintable() or any(len(part.encode()) > _MAX_NAME for part in inside.parts):
        raise ValueError(f"{printable(name):.100} is not the name of a file")
    return name


_entry = partial(dataclass, frozen=True, slots=True, kw_only=True)


@_entry
class _Category:
    id: int
    name: str = Field(max_length=1000)


@_entry
class _Annotation:
    image_id: int
    category_id: int
    bbox: tuple[Number, Number, Number, Number]
    iscrowd: int = Field(0, ge=0, le=1, strict=False)


@_entry
class _TrackAnnotation(_Annotation):
    track_id: _Id
    score: Number = 1.0
    attributes: dict[str, Any] = Field({})


@_entry
class _Image:
    id: int
    width: _Side | None = None
    height: _Side | None = None

    @property
    def size(self) -> tuple[int, int] | None:
        return (self.width, self.height) if self.width and self.height else None


@_entry
class _Picture(_Image):
    file_name: Annotated[str, Field(min_length=1, max_length=1000), AfterValidator(_inside)]


@_entry
class _Frame(_Image):
    frame_index: Index
    video_id: _Id = _VIDEO
    time: float | None = None


@_entry
class _Info:
    unlabelled_classes: tuple[str, ...] = ()


class _Document:
    """The needed content of a COCO file.

    `entries` are the images and the categories by their id; `annotations` are by the id of their
    image, each with its number in the file. `unlabelled` are the classes that the file does not
    label although they may be there: `unlabelled_classes` of its `info`, a key of our own.
    """

    def __init__(self, path: Path, file: BinaryIO, form: str, image: type, entry: type) -> None:
        self.path = path
        self.entries: dict[str, dict[int, Any]] = {"images": {}, "categories": {}}
        self.annotations: dict[int, list[tuple[int, Any]]] = defaultdict(list)
        self.unlabelled: tuple[str, ...] = ()
        kinds = {"images": image, "annotations": entry, "categories": _Category, "info": _Info}
        lists = JsonLists(file.read, {name: TypeAdapter[Any](kind) for name, kind in kinds.items()})
        try:
            for name, number, value in lists:
                self._add(name, number, value)
            if missing := kinds.keys() - lists.found - {"info"}:
                raise ValueError(f"the list {min(missing)} is missing")
        except ValueError as error:
            raise TruthError(f"{path}: is not {form}: {error}") from error

    def _add(self, name: str, number: int, value: Any) -> None:
        if number == (MAX_PICTURES if name == "images" else MAX_BOXES):
            raise ValueError(f"there are more than {number:,} {name}; cut the file into parts")
        if name == "info":
            self.unlabelled = value.unlabelled_classes
        elif name == "annotations":
            self.annotations[value.image_id].append((number, value))
        elif self.entries[name].setdefault(value.id, value) is not value:
            raise ValueError(f"{name}.{number}: the id {value.id} is there already")

    def labels(self) -> Iterator[tuple[Any, list[tuple[Any, Label]]]]:
        """Yield each image with its annotations, each also as a label. Raises `TruthError`."""
        images, categories = self.entries["images"], self.entries["categories"]
        for image_id in self.annotations.keys() - images.keys():
            number, _ = self.annotations[image_id][0]
            raise line_error(self.path, f"annotations.{number}", f"no image has the id {image_id}")
        for image in images.values():
            found = []
            for number, each in self.annotations.pop(image.id, ()):
                place, category = f"annotations.{number}", categories.get(each.category_id)
                if category is None:
                    what = f"no category has the id {each.category_id}"
                    raise line_error(self.path, place, what)
                box, ignored = from_size(*each.bbox), bool(each.iscrowd)
                found.append((each, Label(place, box, category.name, ignored=ignored)))
            yield image, found


def read_coco(path: Path, data: bytes) -> SavedTracks:
    """Read the boxes of one video; `iscrowd: 1` marks an ignore region.

    Raises
    ------
    TruthError
        The file is not of this form, has several videos, an id of images or categories or a frame
        appears twice, a time is wrong, or an annotation names an image or a category that is not
        there.
    """
    form = "COCO with tracks"
    document = _Document(path, io.BytesIO(data), form, _Frame, _TrackAnnotation)
    images: list[_Frame] = list(document.entries["images"].values())
    if len({image.video_id for image in images}) > 1:
        raise TruthError(f"{path}: has images of several videos; give a file for each")
    frames = {each.frame_index: (f"images.{number}", each) for number, each in enumerate(images)}
    if len(frames) < len(images):
        raise TruthError(f"{path}: a frame_index of images appears twice")

    def labels() -> Iterator[Label]:
        for image, annotations in document.labels():
            for each, label in annotations:
                frame, id_, score = image.frame_index + 1, each.track_id, each.score
                state: State = "lost" if each.attributes.get("occluded") else "seen"
                yield label._replace(frame=frame, id=id_, score=score, state=state)

    times: Times = {
        n: (place, each.time) for n, (place, each) in frames.items() if each.time is not None
    }
    listed, size = tuple(sorted(frames)), images[0].size if images else None
    return SavedTracks(tuple(limited(path, labels())), listed, checked_times(path, times), size)


COCO = Format("COCO", ".coco.json", read_coco, whole=_write)


def read_coco_pictures(path: Path) -> Iterator[LabelledPicture]:
    """Yield every picture of a COCO file; `iscrowd: 1` marks an ignore region.

    Pictures lie beside the file or at most two folders below, as in `images/default` of CVAT; if
    the file is in `annotations`, beside or below that folder. Only boxes and categories are used.

    Raises
    ------
    TruthError
        The file is not of this form, an annotation names a picture or a category that is not
        there, an id appears twice, there are more than `MAX_PICTURES` or `MAX_BOXES`, or a picture
        lies outside.
    """
    try:
        with path.open("rb") as file:
            record_input(file.fileno())
            document = _Document(path, file, "COCO", _Picture, _Annotation)
    except OSError as error:
        raise TruthError(f"{path}: cannot be read: {error.strerror}") from error
    folder = _picture_folder(
        path, [image.file_name for image in document.entries["images"].values()]
    )
    for image, annotations in document.labels():
        labels, picture = tuple(label for _, label in annotations), folder / image.file_name
        yield LabelledPicture(picture, path, labels, image.size, document.unlabelled)


def _picture_folder(path: Path, names: Sequence[str]) -> Path:
    """Return the folder that the names of pictures are relative to: the one with the first."""
    near = path.parent
    if not names or (near / names[0]).is_file():
        return near
    above = near.parent if near.name == _ANNOTATIONS else near
    levels = (above,), sorted(above.glob("*/")), sorted(above.glob("*/*/"))
    holding = ([each for each in level if (each / names[0]).is_file()] for level in levels)
    found = next(filter(None, holding), [])
    if len(found) != 1:
        which = " and ".join(str(folder) for folder in found[:2])
        what = f"lies in {which}" if found else "is missing: it should lie beside it or below"
        raise TruthError(f"{path}: its first picture, {names[0]}, {what}")
    return found[0]
