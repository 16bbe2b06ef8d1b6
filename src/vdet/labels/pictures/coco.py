"""Labels in COCO form: one JSON file for all pictures.

Source: Lin et al., "Microsoft COCO: Common Objects in Context", 2014; cocodataset.org, "Data
format".
"""

from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Annotated

from pydantic import BaseModel, Field, ValidationError

from vdet.errors import TruthError
from vdet.files import printable
from vdet.labels.coco import CocoAnnotation, CocoCategory, category_names
from vdet.labels.parsing import first_mistake, read_text
from vdet.labels.pictures.labelled import ImageLabels, Label

_ANNOTATIONS = "annotations"  # the folder of label files in the COCO set itself
_MAX_NAME = 255  # bytes, as in most file systems

_Id = Annotated[int, Field(strict=True)]
_Side = Annotated[int, Field(ge=1, strict=True)]


class _Image(BaseModel, frozen=True):
    id: _Id
    file_name: str = Field(min_length=1, max_length=1000)
    width: _Side | None = None
    height: _Side | None = None


class _Document(BaseModel, frozen=True):
    images: tuple[_Image, ...]
    annotations: tuple[CocoAnnotation, ...]
    categories: tuple[CocoCategory, ...]


def coco_labels(path: Path) -> Iterator[ImageLabels]:
    """Yield every picture of a COCO file; `iscrowd: 1` marks an ignore region.

    Pictures lie beside the file or in a folder beside it; if the file is in `annotations`, also
    beside that folder. Only boxes and categories are used.

    Raises
    ------
    TruthError
        The file is not of this form, an annotation names a picture or a category that is not
        there, an id comes twice, or a picture lies outside.
    """
    try:
        document = _Document.model_validate_json(read_text(path))
    except ValidationError as error:
        raise TruthError(f"{path}: is not COCO: {first_mistake(error)}") from error
    labels = _labels_by_image(path, document)
    folder = _picture_folder(path, document)
    for number, image in enumerate(document.images):
        size = (image.width, image.height) if image.width and image.height else None
        picture = folder / _inside(image.file_name, f"{path}: images.{number}")
        yield ImageLabels(picture, tuple(labels[image.id]), size)


def _labels_by_image(path: Path, document: _Document) -> dict[int, list[Label]]:
    names = category_names(path, document.categories)
    labels: dict[int, list[Label]] = defaultdict(list)
    images = {image.id for image in document.images}
    if len(images) < len(document.images):
        raise TruthError(f"{path}: an id of images comes twice")
    for number, each in enumerate(document.annotations):
        place = f"{path}: annotations.{number}"
        if each.image_id not in images:
            raise TruthError(f"{place}: no image has the id {each.image_id}")
        if each.category_id not in names:
            raise TruthError(f"{place}: no category has the id {each.category_id}")
        label = Label(place, names[each.category_id], *each.bbox, ignored=bool(each.iscrowd))
        labels[each.image_id].append(label)
    return labels


def _inside(name: str, place: str) -> PurePosixPath:
    """Refuse the name of a picture that leads out of the set, or cannot be one."""
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts:
        raise TruthError(f"{place}: the file_name {printable(name)} leads out of the set")
    if not name.isprintable() or any(len(part.encode()) > _MAX_NAME for part in path.parts):
        raise TruthError(f"{place}: {printable(name)} is no name of a file")
    return path


def _picture_folder(path: Path, document: _Document) -> Path:
    """Return the folder from which the names of pictures count: that which has the first one."""
    near = path.parent
    if not document.images:
        return near
    name = _inside(document.images[0].file_name, f"{path}: images.0")
    if (near / name).is_file():
        return near
    others = _folders_in(near)
    if near.name == _ANNOTATIONS:
        others += [near.parent, *_folders_in(near.parent)]
    found = [folder for folder in others if (folder / name).is_file()]
    if len(found) != 1:
        which = " and ".join(str(folder) for folder in found[:2])
        what = f"lies in {which}" if found else "is missing: it should lie beside it or below"
        raise TruthError(f"{path}: its first picture, {printable(str(name))}, {what}")
    return found[0]


def _folders_in(folder: Path) -> list[Path]:
    return sorted(each for each in folder.iterdir() if each.is_dir())
