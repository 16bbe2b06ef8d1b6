"""COCO with tracks: one JSON document; all ids count from 1, frames and pixels from 0.

Beside the `images`, `annotations` and `categories` of COCO there are `videos` and `tracks`. An
image names its `video_id` and `frame_index`, an annotation its `track_id`.
Source: Lin et al., "Microsoft COCO: Common Objects in Context", 2014; Dave et al., "TAO: A
Large-Scale Benchmark for Tracking Any Object", 2020.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, BinaryIO

from pydantic import BaseModel, Field, ValidationError

from vdet.errors import TruthError
from vdet.labels.parsing import LIMIT, JsonNumber, first_mistake, text_of
from vdet.labels.protocol import UNKNOWN, Format, SourceVideo, TrackLabels
from vdet.labels.rows import Row, limited, line_error
from vdet.labels.saved import SavedTracks
from vdet.lanes.road import Road
from vdet.track.track import FrameTracks, Track

_VIDEO = 1
"""Id of the only video."""


class CocoWriter:
    """Keeps images and annotations, each as its text, and writes all at the end.

    An annotation has a `score`, and an image its `time` in seconds, which other programs pass over.
    `attributes.occluded` says that the box is predicted.
    """

    def __init__(self, file: BinaryIO, video: SourceVideo | None) -> None:
        assert video is not None  # `needs_video` says so
        self._file = file
        self._video = video
        self._images: list[str] = []
        self._annotations: list[str] = []
        self._categories: dict[str, int] = {}  # name: id, in the order of their ids
        self._labels = TrackLabels()
        self._tracks: set[int] = set()

    def write(self, frame: FrameTracks, road: Road | None = None) -> None:  # noqa: ARG002
        """Keep a frame and its boxes."""
        image = {
            "id": len(self._images) + 1,
            "video_id": _VIDEO,
            "frame_index": frame.index,
            "file_name": f"frame_{frame.index:06}.png",
            "width": self._video.width,
            "height": self._video.height,
            "time": round(frame.time, 6),
        }
        self._images.append(json.dumps(image))
        for track in frame.tracks:
            self._tracks.add(track.id)
            self._labels.add(track)
            self._annotations.append(json.dumps(self._annotation(track)))

    def _annotation(self, track: Track) -> dict[str, Any]:
        box = track.box
        return {
            "id": len(self._annotations) + 1,
            "image_id": len(self._images),
            "category_id": self._category(track.class_name or UNKNOWN),
            "track_id": track.id,
            "bbox": [box.x, box.y, box.width, box.height],
            "area": box.area,
            "iscrowd": 0,
            "score": round(track.score, 4),
            "attributes": {"occluded": track.predicted},
        }

    def _category(self, name: str) -> int:
        return self._categories.setdefault(name, len(self._categories) + 1)

    def end(self) -> None:
        """Write the whole file."""
        video = {
            "id": _VIDEO,
            "name": self._video.name,
            "width": self._video.width,
            "height": self._video.height,
        }
        tracks = [
            {
                "id": number,
                "video_id": _VIDEO,
                "category_id": self._category(self._labels.label(number)),
            }
            for number in sorted(self._tracks)
        ]
        categories = [{"id": number, "name": name} for name, number in self._categories.items()]
        lists = {
            "videos": [json.dumps(video)],
            "images": self._images,
            "tracks": list(map(json.dumps, tracks)),
            "annotations": self._annotations,
            "categories": list(map(json.dumps, categories)),
        }
        parts = (f'"{name}": [\n' + ",\n".join(items) + "\n]" for name, items in lists.items())
        self._file.write(("{\n" + ",\n".join(parts) + "\n}\n").encode())


_Id = Annotated[int, Field(ge=-LIMIT, le=LIMIT, strict=True)]
_Index = Annotated[int, Field(ge=0, le=LIMIT, strict=True)]
_Side = Annotated[int, Field(ge=1, le=LIMIT, strict=True)]


class CocoCategory(BaseModel, frozen=True):
    """A class, as it is called in the file."""

    id: _Id
    name: str = Field(max_length=1000)


class CocoAnnotation(BaseModel, frozen=True):
    """A box, as x, y, width, height in pixels from 0; `iscrowd: 1` marks an ignore region."""

    image_id: _Id
    category_id: _Id
    bbox: tuple[JsonNumber, JsonNumber, JsonNumber, JsonNumber]
    iscrowd: int = Field(0, ge=0, le=1)


class _Image(BaseModel, frozen=True):
    id: _Id
    frame_index: _Index
    video_id: _Id = _VIDEO
    width: _Side | None = None
    height: _Side | None = None
    time: JsonNumber | None = None


class _Attributes(BaseModel, frozen=True):
    occluded: bool = False


class _Annotation(CocoAnnotation, frozen=True):
    track_id: _Id
    score: JsonNumber = 1.0
    attributes: _Attributes = _Attributes()


class _Document(BaseModel, frozen=True):
    images: tuple[_Image, ...]
    annotations: tuple[_Annotation, ...]
    categories: tuple[CocoCategory, ...]


def read_coco(path: Path, data: bytes) -> SavedTracks:
    """Read the boxes of one video.

    Raises
    ------
    TruthError
        The file is not of this form, has several videos, an id of images or categories or a frame
        comes twice, or an annotation names an image or a category that is not there.
    """
    try:
        document = _Document.model_validate_json(text_of(path, data))
    except ValidationError as error:
        raise TruthError(f"{path}: is not COCO with tracks: {first_mistake(error)}") from error
    images = _images_by_id(path, document)
    names = category_names(path, document.categories)
    frames = sorted(images.values(), key=lambda image: image.frame_index)
    first = next(iter(frames), None)
    return SavedTracks(
        tuple(limited(path, _rows(path, document.annotations, images, names))),
        listed=tuple(image.frame_index for image in frames),
        times={image.frame_index: image.time for image in frames if image.time is not None},
        size=(first.width, first.height) if first and first.width and first.height else None,
    )


def category_names(path: Path, categories: tuple[CocoCategory, ...]) -> dict[int, str]:
    """Return the name of each category by its id. Raises `TruthError` if an id comes twice."""
    names = {category.id: category.name for category in categories}
    if len(names) < len(categories):
        raise TruthError(f"{path}: an id of categories comes twice")
    return names


def _images_by_id(path: Path, document: _Document) -> dict[int, _Image]:
    images = {image.id: image for image in document.images}
    if len(images) < len(document.images):
        raise TruthError(f"{path}: an id of images comes twice")
    if len({image.video_id for image in document.images}) > 1:
        raise TruthError(f"{path}: has images of several videos; give a file for each")
    if len({image.frame_index for image in document.images}) < len(images):
        raise TruthError(f"{path}: a frame_index of images comes twice")
    return images


def _rows(
    path: Path,
    annotations: tuple[_Annotation, ...],
    images: dict[int, _Image],
    names: dict[int, str],
) -> Iterator[Row]:
    for number, each in enumerate(annotations):
        place = f"annotations.{number}"
        if each.image_id not in images:
            raise line_error(path, place, f"no image has the id {each.image_id}")
        if each.category_id not in names:
            raise line_error(path, place, f"no category has the id {each.category_id}")
        yield Row(
            place,
            images[each.image_id].frame_index + 1,
            each.track_id,
            *each.bbox,
            score=each.score,
            ignored=bool(each.iscrowd),
            label=names[each.category_id],
            predicted=each.attributes.occluded,
        )


COCO = Format("COCO", ".coco.json", CocoWriter, read_coco, needs_video=True)
