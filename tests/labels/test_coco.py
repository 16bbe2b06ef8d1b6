import json
from dataclasses import astuple
from pathlib import Path
from typing import Any

import pytest

from labels.saving import car, frame, written
from labels.writers import exported
from vdet.errors import TruthError
from vdet.labels.coco import COCO, read_coco

FRAMES = [frame(4, car(3)), frame(5), frame(6, car(3), car(5, class_name="bus", state="predicted"))]


FILE = Path("a.json")


def document() -> dict[str, Any]:
    made: dict[str, Any] = json.loads(written(COCO, FRAMES))
    return made


def test_images_name_their_frame_and_annotations_their_track() -> None:
    made = document()
    assert [image["frame_index"] for image in made["images"]] == [4, 5, 6]
    assert {image["video_id"] for image in made["images"]} == {made["videos"][0]["id"]}
    assert [(a["image_id"], a["track_id"]) for a in made["annotations"]] == [(1, 3), (3, 3), (3, 5)]
    categories = {item["id"]: item["name"] for item in made["categories"]}
    assert {t["id"]: categories[t["category_id"]] for t in made["tracks"]} == {3: "car", 5: "bus"}


def test_cvat_finds_what_it_needs_to_import_tracks() -> None:
    vehicle = document()["annotations"][2]
    assert vehicle["segmentation"] == []
    assert vehicle["attributes"] == {"occluded": True, "track_id": 5, "keyframe": True}
    assert [image["file_name"] for image in document()["images"]] == [
        *("frame_000004.png", "frame_000005.png", "frame_000006.png")
    ]


def test_tracks_that_cvat_exports_are_read() -> None:
    saved = read_coco(FILE, exported({0: [7], 5: [], 10: [7, 8]}))
    assert saved.covered == (0, 5, 10)
    assert saved.size == (300, 200)
    assert {index: [row.id for row in rows] for index, rows in saved.frames.items()} == {
        0: [7],
        10: [7, 8],
    }
    assert {astuple(row.box) for row in saved.tracks} == {(1, 1, 9, 9)}


def changed(name: str, number: int, **values: object) -> bytes:
    made = document()
    made[name][number] |= values
    return json.dumps(made).encode()


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"{", ": is not COCO: Invalid JSON: EOF while parsing an object"),
        (changed("images", 1, id=1), ": is not COCO: an id of images or categories occurs twice"),
        (changed("images", 1, frame_index=4), ": a frame_index occurs twice; use one file"),
        (changed("images", 1, time=0.15), ":images.1: frame 5 is at 0.15 s; times must"),
        (changed("images", 1, frame_index=-1), ": is not COCO: images.1.frame_index: Input should"),
        (changed("categories", 1, id=1), ": is not COCO: an id of images or categories occurs"),
        (changed("annotations", 2, image_id=9), ":annotations.2: image 9 or category 2 not found"),
        (changed("annotations", 2, category_id=9), ":annotations.2: image 3 or category 9 not"),
        (changed("annotations", 2, bbox=[1, 2, 3]), ": is not COCO: annotations.2.bbox.3: Field"),
        (changed("images", 1, frame_index=None, file_name="im5.png"), ": needs the frame_index of"),
        (changed("images", 1, frame_index=None, file_name="frame_123456789.txt"), ": needs the fr"),
        (exported({0: [1]}, attributes={}), ": needs the frame_index of each image and the track_"),
        (exported({0: [1]}, attributes={"track_id": "x"}), ": needs the frame_index of each image"),
    ],
)
def test_what_does_not_fit_is_refused_with_its_place(data: bytes, message: str) -> None:
    with pytest.raises(TruthError) as caught:
        read_coco(FILE, data)
    assert str(caught.value).startswith(f"a.json{message}")
