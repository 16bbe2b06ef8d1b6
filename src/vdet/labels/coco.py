"""COCO: one JSON document, of the tracks of a video or of a set of pictures.

For tracks there are `videos` and `tracks` beside the `images`, `annotations` and `categories` of
COCO. An image names its `video_id` and `frame_index`, an annotation its `track_id`. All ids count
from 1, frames and pixels from 0.
Source: Lin et al., "Microsoft COCO: Common Objects in Context", 2014; cocodataset.org, "Data
format"; Dave et al., "TAO: A Large-Scale Benchmark for Tracking Any Object", 2020.
"""

import json
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, BinaryIO, Generic, Self, TypeVar

from pydantic import AfterValidator, BaseModel, Field, ValidationError

from vdet.detect.classes import ClassScores
from vdet.errors import TruthError
from vdet.files import printable
from vdet.labels.formats import UNKNOWN, Format, SourceVideo
from vdet.labels.label import Label, from_size, limited, line_error
from vdet.labels.parsing import LIMIT, Index, Number, first_mistake, read_text, text_of
from vdet.labels.pictures import LabelledPicture
from vdet.labels.video import SavedTracks
from vdet.track.track import FrameTracks, Track

_VIDEO = 1
"""Id of the only video."""

_ANNOTATIONS = "annotations"  # the folder of label files in the COCO set itself
_MAX_NAME = 255  # bytes, as in most file systems


class CocoWriter:
    """Keeps images and annotations, each as its text, and writes all at the end.

    An annotation has a `score`, and an image its `time` in seconds, which other programs ignore.
    `attributes.occluded` says that the box is predicted.
    """

    def __init__(self, file: BinaryIO, video: SourceVideo | None) -> None:
        assert video is not None  # `needs_video` says so
        self._file = file
        self._name = video.name
        self._size = {"width": video.width, "height": video.height}
        self._images: list[str] = []
        self._annotations: list[str] = []
        self._categories: dict[str, int] = {}  # name: id, in the order of their ids
        self._classes: dict[int, ClassScores] = defaultdict(ClassScores)

    def write(self, frame: FrameTracks) -> None:
        """Keep a frame and its boxes."""
        image = {
            "id": len(self._images) + 1,
            "video_id": _VIDEO,
            "frame_index": frame.index,
            "file_name": f"frame_{frame.index:06}.png",
            **self._size,
            "time": round(frame.time, 6),
        }
        self._images.append(json.dumps(image))
        for track in frame.tracks:
            self._classes[track.id].add(track.class_name or UNKNOWN, track.score)
            self._annotations.append(json.dumps(self._annotation(track)))

    def _annotation(self, track: Track) -> dict[str, Any]:
        x, y, width, height = track.box.xywh
        return {
            "id": len(self._annotations) + 1,
            "image_id": len(self._images),
            "category_id": self._category(track.class_name or UNKNOWN),
            "track_id": track.id,
            "bbox": [x, y, width, height],
            "area": width * height,
            "iscrowd": 0,
            "score": round(track.score, 4),
            "attributes": {"occluded": track.predicted},
        }

    def _category(self, name: str) -> int:
        return self._categories.setdefault(name, len(self._categories) + 1)

    def end(self) -> None:
        """Write the whole file."""
        tracks = [
            {"id": id_, "video_id": _VIDEO, "category_id": self._category(classes.best or UNKNOWN)}
            for id_, classes in sorted(self._classes.items())
        ]
        categories = [{"id": number, "name": name} for name, number in self._categories.items()]
        lists = {
            "videos": [json.dumps({"id": _VIDEO, "name": self._name, **self._size})],
            "images": self._images,
            "tracks": map(json.dumps, tracks),
            "annotations": self._annotations,
            "categories": map(json.dumps, categories),
        }
        parts = (f'"{name}": [\n' + ",\n".join(items) + "\n]" for name, items in lists.items())
        self._file.write(("{\n" + ",\n".join(parts) + "\n}\n").encode())


_Id = Annotated[int, Field(ge=-LIMIT, le=LIMIT)]
_Side = Annotated[int, Field(ge=1, le=LIMIT)]


class _Category(BaseModel, frozen=True):
    id: int
    name: str = Field(max_length=1000)


class _Annotation(BaseModel, frozen=True):
    image_id: int
    category_id: int
    bbox: tuple[Number, Number, Number, Number]
    iscrowd: int = Field(0, ge=0, le=1, strict=False)


class _Image(BaseModel, frozen=True):
    id: int
    width: _Side | None = None
    height: _Side | None = None

    @property
    def size(self) -> tuple[int, int] | None:
        return (self.width, self.height) if self.width and self.height else None


def _inside(name: str) -> str:
    """Refuse the name of a picture that leads out of the set, or cannot be one."""
    inside = PurePosixPath(name)
    if inside.is_absolute() or ".." in inside.parts:
        raise ValueError(f"{printable(name)} leads out of the set")
    if not name.isprintable() or any(len(part.encode()) > _MAX_NAME for part in inside.parts):
        raise ValueError(f"{printable(name):.100} is not the name of a file")
    return name


class _Picture(_Image, frozen=True):
    file_name: Annotated[str, Field(min_length=1, max_length=1000), AfterValidator(_inside)]


class _Frame(_Image, frozen=True):
    frame_index: Index
    video_id: _Id = _VIDEO
    time: Number | None = None


class _Attributes(BaseModel, frozen=True):
    occluded: bool = Field(False, strict=False)


class _TrackAnnotation(_Annotation, frozen=True):
    track_id: _Id
    score: Number = 1.0
    attributes: _Attributes = _Attributes()


ImageT = TypeVar("ImageT", _Picture, _Frame)
AnnotationT = TypeVar("AnnotationT", bound=_Annotation)
EntryT = TypeVar("EntryT", _Category, _Picture, _Frame)


def _unique(entries: tuple[EntryT, ...]) -> tuple[EntryT, ...]:
    if len({each.id for each in entries}) < len(entries):
        raise ValueError("an id appears twice")
    return entries


class _Document(BaseModel, Generic[ImageT, AnnotationT], frozen=True):
    images: Annotated[tuple[ImageT, ...], AfterValidator(_unique)]
    annotations: tuple[AnnotationT, ...]
    categories: Annotated[tuple[_Category, ...], AfterValidator(_unique)]

    @classmethod
    def of(cls, path: Path, text: str, name: str) -> Self:
        """Read the text of a file. Raises `TruthError`."""
        try:
            return cls.model_validate_json(text, strict=True)
        except ValidationError as error:
            raise TruthError(f"{path}: is not {name}: {first_mistake(error)}") from error

    def labels(self, path: Path) -> Iterator[tuple[ImageT, AnnotationT, Label]]:
        """Yield each annotation with its image and as a label. Raises `TruthError`."""
        images = {each.id: each for each in self.images}
        names = {each.id: each.name for each in self.categories}
        for number, each in enumerate(self.annotations):
            place = f"annotations.{number}"
            if each.image_id not in images:
                raise line_error(path, place, f"no image has the id {each.image_id}")
            if each.category_id not in names:
                raise line_error(path, place, f"no category has the id {each.category_id}")
            box, ignored = from_size(*each.bbox), bool(each.iscrowd)
            yield (
                images[each.image_id],
                each,
                Label(place, box, names[each.category_id], ignored=ignored),
            )


def read_coco(path: Path, data: bytes) -> SavedTracks:
    """Read the boxes of one video; `iscrowd: 1` marks an ignore region.

    Raises
    ------
    TruthError
        The file is not of this form, has several videos, an id of images or categories or a frame
        appears twice, or an annotation names an image or a category that is not there.
    """
    form = _Document[_Frame, _TrackAnnotation]
    video = form.of(path, text_of(path, data), "COCO with tracks")
    if len({image.video_id for image in video.images}) > 1:
        raise TruthError(f"{path}: has images of several videos; give a file for each")
    frames = {image.frame_index: image for image in video.images}
    if len(frames) < len(video.images):
        raise TruthError(f"{path}: a frame_index of images appears twice")
    labels = (
        replace(
            label,
            frame=image.frame_index + 1,
            id=each.track_id,
            score=each.score,
            predicted=each.attributes.occluded,
        )
        for image, each, label in video.labels(path)
    )
    return SavedTracks(
        tuple(limited(path, labels)),
        listed=tuple(sorted(frames)),
        times={index: image.time for index, image in frames.items() if image.time is not None},
        size=frames[min(frames)].size if frames else None,
    )


COCO = Format("COCO", ".coco.json", read_coco, CocoWriter, needs_video=True)


def read_coco_pictures(path: Path) -> Iterator[LabelledPicture]:
    """Yield every picture of a COCO file; `iscrowd: 1` marks an ignore region.

    Pictures lie beside the file or in a folder beside it; if the file is in `annotations`, also
    beside that folder. Only boxes and categories are used.

    Raises
    ------
    TruthError
        The file is not of this form, an annotation names a picture or a category that is not
        there, an id appears twice, or a picture lies outside.
    """
    found = _Document[_Picture, _Annotation].of(path, read_text(path), "COCO")
    labels: dict[int, list[Label]] = defaultdict(list)
    for image, _, label in found.labels(path):
        labels[image.id].append(label)
    folder = _picture_folder(path, found.images)
    for image in found.images:
        yield LabelledPicture(folder / image.file_name, path, tuple(labels[image.id]), image.size)


def _picture_folder(path: Path, images: Sequence[_Picture]) -> Path:
    """Return the folder that the names of pictures are relative to: that with the first one."""
    near = path.parent
    if not images or (near / images[0].file_name).is_file():
        return near
    above = [near, near.parent] if near.name == _ANNOTATIONS else [near]
    below = (each for folder in above for each in sorted(folder.iterdir()) if each.is_dir())
    name = images[0].file_name
    found = [folder for folder in (*above, *below) if (folder / name).is_file()]
    if len(found) != 1:
        which = " and ".join(str(folder) for folder in found[:2])
        what = f"lies in {which}" if found else "is missing: it should lie beside it or below"
        raise TruthError(f"{path}: its first picture, {name}, {what}")
    return found[0]
