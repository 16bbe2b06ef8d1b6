import json
from pathlib import Path
from typing import Any

import pytest

from labels.saving import car, frame, written
from vdet.errors import TruthError
from vdet.labels.coco import COCO, read_coco

FRAMES = [frame(4, car(3)), frame(5), frame(6, car(3), car(5, class_name="bus", state="lost"))]


def document() -> dict[str, Any]:
    made: dict[str, Any] = json.loads(written(COCO, FRAMES))
    return made


def test_images_name_their_frame_and_annotations_their_track() -> None:
    made = document()
    assert [image["frame_index"] for image in made["images"]] == [4, 5, 6]
    assert {image["video_id"] for image in made["images"]} == {made["videos"][0]["id"]}
    assert [(a["image_id"], a["track_id"]) for a in made["annotations"]] == [(1, 3), (3, 3), (3, 5)]
    categories = {each["id"]: each["name"] for each in made["categories"]}
    assert {t["id"]: categories[t["category_id"]] for t in made["tracks"]} == {3: "car", 5: "bus"}


def test_a_video_without_boxes_is_read(tmp_path: Path) -> None:
    saved = read_coco(tmp_path, written(COCO, [frame(0), frame(1)]))
    assert (saved.labels, saved.listed, saved.size) == ((), (0, 1), (1280, 720))


def changed(name: str, number: int, **values: object) -> bytes:
    made = document()
    made[name][number] |= values
    return json.dumps(made).encode()


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"{", ": is not COCO with tracks: invalid JSON"),
        (b'{"images": []}', ": is not COCO with tracks: the list annotations is missing"),
        (
            changed("images", 1, id=1),
            ": is not COCO with tracks: images.1: the id 1 is there already",
        ),
        (changed("images", 1, frame_index=4), ": a frame_index of images appears twice"),
        (changed("images", 1, video_id=2), ": has images of several videos"),
        (
            changed("images", 1, time=0.15),
            ":images.1: frame 5 is at 0.15 s; times must",
        ),
        (changed("images", 1, frame_index=-1), ": is not COCO with tracks: images.1: frame_index"),
        (
            changed("categories", 1, id=1),
            ": is not COCO with tracks: categories.1: the id 1 is there already",
        ),
        (changed("annotations", 2, image_id=9), ":annotations.2: no image has the id 9"),
        (changed("annotations", 2, category_id=9), ":annotations.2: no category has the id 9"),
        (
            changed("annotations", 2, bbox=[1, 2, 3]),
            ": is not COCO with tracks: annotations.2: bbox",
        ),
        (
            changed("annotations", 2, track_id=None),
            ": is not COCO with tracks: annotations.2: track",
        ),
    ],
)
def test_what_does_not_fit_is_refused_with_its_place(data: bytes, message: str) -> None:
    with pytest.raises(TruthError) as caught:
        read_coco(Path("a.json"), data)
    assert str(caught.value).startswith(f"a.json{message}")


def test_a_crowd_is_an_ignore_region() -> None:
    saved = read_coco(Path("a.json"), changed("annotations", 0, iscrowd=1))
    assert [row.ignored for row in saved.labels] == [True, False, False]
