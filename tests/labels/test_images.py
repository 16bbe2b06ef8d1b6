"""Labelled pictures, read from both forms."""

import json
import shutil
from dataclasses import astuple
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from labels.writers import (
    NAMES,
    WRITERS,
    Boxed,
    Labelled,
    Pictures,
    write_coco,
    write_pictures,
    write_yolo,
)
from vdet.boxes import Box
from vdet.errors import ImageError, TruthError
from vdet.labels.label import boxes_of
from vdet.labels.reading import read_labelled_images

FORMS = list(WRITERS)
WIDTH, HEIGHT = 64, 32
BOXES = (
    *(Boxed("car", (1, 2, 20, 10)), Boxed("truck", (30.5, 4, 10, 20))),
    *(Boxed("ignore", (0, 0, 5, 5)), Boxed("cow", (50, 10, 4, 12))),
)
SCENE: Pictures = {"a": Labelled(WIDTH, HEIGHT, BOXES), "b": Labelled(WIDTH, HEIGHT)}

lengths = st.tuples(st.integers(0, 2 * WIDTH - 1), st.integers(1, 2 * WIDTH)).map(
    lambda pair: (pair[0] / 2, min(pair[1], 2 * WIDTH - pair[0]) / 2)
)


@st.composite
def boxes(draw: st.DrawFn) -> Boxed:
    (x, width), (y, height) = draw(lengths), draw(lengths)
    return Boxed(draw(st.sampled_from(NAMES)), (x, y / 2, width, height / 2))


scenes = st.dictionaries(
    st.sampled_from(["0001", "0002", "some name", "ü"]),
    st.lists(boxes(), max_size=5).map(lambda item: Labelled(WIDTH, HEIGHT, tuple(item))),
    min_size=1,
    max_size=3,
)
numbers = count()


def fresh(factory: pytest.TempPathFactory) -> Path:
    """Return a folder of its own for an example; hypothesis runs many in one test."""
    return factory.getbasetemp() / f"set-{next(numbers)}"


@pytest.mark.parametrize("form", FORMS)
@settings(max_examples=10)
@given(scene=scenes)
def test_what_is_written_is_read_back(
    tmp_path_factory: pytest.TempPathFactory, form: str, scene: Pictures
) -> None:
    folder = fresh(tmp_path_factory)
    WRITERS[form](folder, scene)
    found = read_labelled_images(folder)
    assert found.name == str(folder)
    assert sorted(picture.path.stem for picture in found.images) == sorted(scene)
    for image in found.images:
        expected = [b for b in scene[image.path.stem].boxes if b.name != "cow"]
        written = np.array([astuple(Box.sized(*b.box)) for b in expected]).reshape(-1, 4)
        assert np.allclose(boxes_of(image.labels), written, atol=1e-6)
        assert [label.ignored for label in image.labels] == [b.name == "ignore" for b in expected]
        vehicles = [label.class_name for label in image.labels if not label.ignored]
        assert vehicles == [b.name for b in expected if b.name != "ignore"]
    shutil.rmtree(folder)


@pytest.mark.parametrize("form", FORMS)
def test_a_missing_picture_is_named(tmp_path: Path, form: str) -> None:
    WRITERS[form](tmp_path, SCENE)
    next(tmp_path.rglob("a.png")).unlink()
    with pytest.raises(TruthError, match=r"\ba\b"):
        read_labelled_images(tmp_path)


@pytest.mark.parametrize("form", ["COCO", "YOLO"])
def test_a_picture_of_another_size_than_its_labels_say_is_refused(
    tmp_path: Path, form: str
) -> None:
    WRITERS[form](tmp_path, SCENE)
    image = read_labelled_images(tmp_path).images[0]
    assert image.read().shape == (HEIGHT, WIDTH, 3)
    write_pictures(image.path.parent, {"a": Labelled(HEIGHT, WIDTH)})
    with pytest.raises(ImageError, match=r"a\.png: is 32×64, .* labels are for 64×32"):
        image.read()


@pytest.mark.parametrize("form", FORMS)
def test_hidden_files_are_passed_over(tmp_path: Path, form: str) -> None:
    file = WRITERS[form](tmp_path, SCENE)
    for folder in (file.parent, next(tmp_path.rglob("a.png")).parent):
        for name in (f"._{file.name}", "._a.png", ".DS_Store", "Thumbs.db"):
            (folder / name).write_bytes(b"\0\5")
    found = [picture.path.name for picture in read_labelled_images(tmp_path).images]
    assert found == ["a.png", "b.png"]


def scene_of(*boxes: tuple[float, float, float, float]) -> Pictures:
    return {"a": Labelled(WIDTH, HEIGHT, tuple(Boxed("car", box) for box in boxes))}


def test_a_label_that_occurs_twice_counts_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write_coco(tmp_path, scene_of((1, 2, 20, 10), (1, 2, 20, 10), (1, 2, 20, 11)))
    (picture,) = read_labelled_images(tmp_path).images
    assert [astuple(label.box) for label in picture.labels] == [(1, 2, 21, 12), (1, 2, 21, 13)]
    assert caplog.messages == [f"{tmp_path}: has 1 label twice in the same image; each counts once"]


@pytest.mark.parametrize(
    "boxes",
    [
        [(0.1, 0.2, 0.3, 0.4), (0.5, 0.2, 0.3, 0.4)],  # fractions
        [(40, 20, 60, 30), (30, 10, 50, 30), (1, 1, 9, 9)],  # two corners
    ],
)
def test_boxes_that_cannot_be_pixels_of_their_pictures_are_refused(
    tmp_path: Path, boxes: list[tuple[float, float, float, float]]
) -> None:
    write_coco(tmp_path, scene_of(*boxes))
    with pytest.raises(TruthError, match=r"2 of \d boxes are outside their images or within a"):
        read_labelled_images(tmp_path)


def test_where_no_set_is_found_it_says_what_was_looked_for(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "none", tmp_path / "labels.txt"):
        with pytest.raises(
            TruthError, match=r"not found; use a folder with one \.json file \(COCO\)"
        ):
            read_labelled_images(path)
    shutil.copy(write_coco(tmp_path, SCENE), tmp_path / "other.json")
    with pytest.raises(TruthError, match=r"\(annotations\.json, other\.json\); pass the one"):
        read_labelled_images(tmp_path)


@pytest.mark.parametrize("place", ["labels.json", "annotations/labels.json"])
@pytest.mark.parametrize("folder", ["val", "images/default"])  # the second is CVAT's
def test_a_coco_file_may_lie_above_or_beside_the_pictures(
    tmp_path: Path, place: str, folder: str
) -> None:
    written = write_coco(tmp_path / "set" / folder, SCENE)
    path = tmp_path / "set" / place
    path.parent.mkdir(exist_ok=True)
    written.rename(path)
    found = {picture.path.parent for picture in read_labelled_images(path).images}
    assert found == {tmp_path / "set" / folder}
    assert len(read_labelled_images(tmp_path / "set").images) == 2
    write_pictures(tmp_path / "set" / "train", SCENE)
    write_pictures(tmp_path / "set" / "test", SCENE)
    with pytest.raises(TruthError, match=r"first image, a\.png, is in .*; keep one"):
        read_labelled_images(path)


def test_what_other_programs_say_of_an_image_does_not_matter(tmp_path: Path) -> None:
    path = write_coco(tmp_path, SCENE)
    document = json.loads(path.read_text(encoding="utf-8"))
    document["images"][0] |= {"time": "night", "weather": "rain", "camera": "north"}
    path.write_text(json.dumps(document), encoding="utf-8")
    assert len(read_labelled_images(tmp_path).images) == 2


@pytest.mark.parametrize(
    "name",
    [
        *("data\\{}", "C:\\data\\{}", "images/1/{}", "/data/upload/1/{}"),
        *("/data/local-files/?d=images/{}", "https://a.org/data/{}?size=10"),
    ],
)
def test_images_in_other_folders_are_found_by_their_names(tmp_path: Path, name: str) -> None:
    path = write_coco(tmp_path, SCENE)
    document = json.loads(path.read_text(encoding="utf-8"))
    for image in document["images"]:
        image["file_name"] = name.format(image["file_name"])
    path.write_text(json.dumps(document), encoding="utf-8")
    images = read_labelled_images(path).images
    assert [image.path for image in images] == [tmp_path / "a.png", tmp_path / "b.png"]
    document["images"][1]["file_name"] = "b/a.png"  # the last part is no longer unique
    path.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(TruthError, match=r"not found|absolute names"):
        read_labelled_images(path)


@pytest.mark.parametrize(
    ("file", "name"),
    [
        *(("a ü", name) for name in ("a%20%C3%BC.png", "a+%C3%BC.png", "/d/?d=x/a%20ü.png")),
        *(("a ü", name) for name in ("x%2Fa+%C3%BC.png?size=9", "%2E%2E/a%20ü.png")),
        *(("a%20b", name) for name in ("a%20b.png", "/data/a%20b.png")),
    ],
)
def test_names_may_be_addresses(tmp_path: Path, file: str, name: str) -> None:
    path = write_coco(tmp_path, {"x": Labelled(WIDTH, HEIGHT), file: Labelled(WIDTH, HEIGHT)})
    path.write_text(path.read_text(encoding="utf-8").replace(f"{json.dumps(file)[1:-1]}.png", name))
    found = [image.path for image in read_labelled_images(path).images]
    assert found == [tmp_path / "x.png", tmp_path / f"{file}.png"]


def test_boxes_that_are_probably_percent_give_a_hint(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    for width, height, warnings in ((320, 240, 1), (64, 32, 0)):
        write_coco(tmp_path, {"a": Labelled(width, height, (Boxed("car", (5, 5, 40, 20)),))})
        read_labelled_images(tmp_path)
        assert len(caplog.messages) == warnings
        assert all("if these are percent, convert them" in text for text in caplog.messages)
        caplog.clear()


@pytest.mark.parametrize(
    ("key", "values", "words"),
    [
        ("annotations", {"bbox": [1, 2, 3, 1e9]}, "annotations.1.bbox.3: Input should be"),
        ("annotations", {"iscrowd": 2}, "annotations.1.iscrowd: Input should be"),
        ("images", {"file_name": "a.png"}, "has the image a.png twice"),
        ("images", {"file_name": "../a.png"}, "file_name: ../a.png points outside the set"),
        ("images", {"file_name": "..\\a.png"}, "a.png points outside the set"),
        ("images", {"file_name": "x" * 300}, "xx…: not found, but "),
        ("images", {"file_name": "a\u202eb"}, "a\\u202"),
        ("images", {"width": -3}, "images.1.width: Input should be greater"),
    ],
)
def test_a_wrong_entry_of_coco_is_refused_by_its_number(
    tmp_path: Path, key: str, values: dict[str, Any], words: str
) -> None:
    path = write_coco(tmp_path, SCENE)
    document = json.loads(path.read_text(encoding="utf-8"))
    document[key][1].update(values)
    path.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(TruthError) as caught:
        read_labelled_images(path)
    assert words in str(caught.value)
    assert str(caught.value).isprintable()


class TestYolo:
    @pytest.mark.parametrize(
        ("text", "words"),
        [
            ("0 .5 .5 .1 .1\n0 .5 .5 .1", r"a\.txt:2: YOLO has 5 columns, .* has 4"),
            ("0.5 0.5 0.5 0.1 0.1", r"a\.txt:1: class 0\.5 has no name"),
            ("0 0.5 0.5 x 0.1", r"a\.txt:1: could not convert"),
            ("0 320 200 40 30", r"a\.txt:1: a number is not between 0 and 1"),
        ],
    )
    def test_a_wrong_line_is_refused_with_its_place(
        self, tmp_path: Path, text: str, words: str
    ) -> None:
        write_yolo(tmp_path, SCENE).write_text(text, encoding="utf-8")
        with pytest.raises(TruthError, match=words):
            read_labelled_images(tmp_path)

    def test_names_may_lie_above_and_be_numbered(self, tmp_path: Path) -> None:
        write_yolo(tmp_path / "train", SCENE)
        (tmp_path / "train" / "data.yaml").unlink()
        names = "".join(f"  {number}: {name}\n" for number, name in enumerate(NAMES))
        (tmp_path / "data.yaml").write_text(f"names:\n{names}", encoding="utf-8")
        image = read_labelled_images(tmp_path / "train").images[0]
        assert [label.class_name for label in image.labels] == ["car", "truck", "vehicle"]

    def test_a_polygon_is_taken_as_its_box(self, tmp_path: Path) -> None:
        path = write_yolo(tmp_path, SCENE)
        path.write_text("0 0.5 0.5 0.1 0.1\n1 0.25 0.5 0.5 0.75 0.375 1\n", encoding="utf-8")
        image = read_labelled_images(tmp_path).images[0]
        assert [label.class_name for label in image.labels] == ["car", "truck"]
        assert astuple(image.labels[1].box) == (0.25 * WIDTH, 0.5 * HEIGHT, 0.5 * WIDTH, HEIGHT)

    def test_what_lies_less_than_a_pixel_outside_is_moved_to_the_side(self, tmp_path: Path) -> None:
        path = write_yolo(tmp_path, SCENE)
        path.write_text("0 1.000001 0.5 0.125 1.01\n", encoding="utf-8")
        (label,) = read_labelled_images(tmp_path).images[0].labels
        assert astuple(label.box) == (0.9375 * WIDTH, 0, 1.0625 * WIDTH, HEIGHT)

    @pytest.mark.parametrize(
        ("text", "words"),
        [
            (None, r"needs data\.yaml with the names of the classes"),
            ("names: 3\n", r"data\.yaml: names must be a list"),
            ("names: {0: car, 2: bus}\n", r"data\.yaml: names must be a list"),
            ("a: &a [x]\nnames: *a\n", "aliases .* are not accepted"),
        ],
    )
    def test_names_that_cannot_be_used(self, tmp_path: Path, text: str | None, words: str) -> None:
        write_yolo(tmp_path, SCENE)
        (tmp_path / "data.yaml").unlink()
        if text is not None:
            (tmp_path / "data.yaml").write_text(text, encoding="utf-8")
        with pytest.raises(TruthError, match=words):
            read_labelled_images(tmp_path)

    def test_labels_without_a_picture_are_refused(self, tmp_path: Path) -> None:
        path = write_yolo(tmp_path, SCENE)
        (path.parent / "classes.txt").write_text("car\n", encoding="utf-8")
        assert len(read_labelled_images(tmp_path).images) == 2
        path.rename(path.with_name("c.txt"))
        with pytest.raises(TruthError, match=r"c\.txt: has no image of its name below"):
            read_labelled_images(tmp_path)
