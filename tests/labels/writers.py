"""Labelled pictures and videos as other programs write them, for the tests that read them."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vdet.boxes import Image
from vdet.media.images import encode_image

NAMES = ("car", "truck", "bus", "ignore", "cow")


@dataclass(frozen=True)
class Boxed:
    """A labelled box: x, y, width, height in pixels from 0."""

    name: str
    box: tuple[float, float, float, float]


@dataclass(frozen=True)
class Labelled:
    """The size of a picture, and its boxes."""

    width: int
    height: int
    boxes: tuple[Boxed, ...] = ()


Pictures = Mapping[str, Labelled]
"""By name, without a suffix."""


def write_pictures(folder: Path, pictures: Pictures) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, picture in pictures.items():
        show(folder / f"{name}.png", np.zeros((picture.height, picture.width, 3), np.uint8))


def show(path: Path, image: Image) -> None:
    """Write a picture, also where one is already."""
    path.write_bytes(encode_image(image, path))


def write_coco(folder: Path, pictures: Pictures) -> Path:
    write_pictures(folder, pictures)
    images = [
        {"id": number, "file_name": f"{name}.png", "width": item.width, "height": item.height}
        for number, (name, item) in enumerate(pictures.items())
    ]
    annotations = [
        {
            "id": 1,
            "image_id": number,
            "category_id": NAMES.index(boxed.name) + 1,
            "bbox": boxed.box,
            "segmentation": [[1, 2, 3]],
            "iscrowd": int(boxed.name == "ignore"),
        }
        for number, picture in enumerate(pictures.values())
        for boxed in picture.boxes
    ]
    categories = [
        {"id": number, "name": "vehicle" if name == "ignore" else name}
        for number, name in enumerate(NAMES, start=1)
    ]
    document = {"info": {}, "images": images, "annotations": annotations, "categories": categories}
    path = folder / "annotations.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


def write_yolo(folder: Path, pictures: Pictures) -> Path:
    write_pictures(folder / "images", pictures)
    (folder / "labels").mkdir(exist_ok=True)
    (folder / "data.yaml").write_text(f"train: images\nnames: [{', '.join(NAMES)}]\n", "utf-8")
    for name, picture in pictures.items():
        lines = [
            f"{NAMES.index(boxed.name)} {(x + w / 2) / picture.width} "
            f"{(y + h / 2) / picture.height} "
            f"{w / picture.width} {h / picture.height}\n"
            for boxed in picture.boxes
            for x, y, w, h in [boxed.box]
        ]
        if lines:
            (folder / "labels" / f"{name}.txt").write_text("".join(lines), encoding="utf-8")
    return folder / "labels" / f"{min(pictures)}.txt"


_IMAGE = {"license": 0, "flickr_url": "", "coco_url": "", "date_captured": 0}
_BOX = {"category_id": 1, "segmentation": [], "area": 64.0, "bbox": [1.0, 1, 8, 8], "iscrowd": 0}
_ATTRIBUTES = {"occluded": False, "rotation": 0.0, "keyframe": True}


def exported(frames: Mapping[int, Sequence[int]], **known: object) -> bytes:
    """Return what CVAT exports as COCO 1.0 of a video: the ids of the cars of each frame."""
    images = [
        _IMAGE | {"id": n, "width": 300, "height": 200, "file_name": f"frame_{frame:06}.PNG"}
        for n, frame in enumerate(frames, start=1)
    ]
    boxes = [
        _BOX | {"id": n, "image_id": n, "attributes": _ATTRIBUTES | {"track_id": id_}} | known
        for n, ids in enumerate(frames.values(), start=1)
        for id_ in ids
    ]
    categories = [{"id": 1, "name": "car", "supercategory": ""}]
    head = {"licenses": [{"name": "", "id": 0, "url": ""}], "info": {"year": ""}}
    document = {**head, "categories": categories, "images": images, "annotations": boxes}
    return json.dumps(document).encode()


WRITERS: dict[str, Callable[[Path, Pictures], Path]] = {"COCO": write_coco, "YOLO": write_yolo}
"""By the name of the form; each returns the label file of the first picture by name."""
