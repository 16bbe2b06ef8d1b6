"""`vdet detect-image`."""

import json
from pathlib import Path

import pytest

from conftest import Run
from quick import QUICK_OPTIONS, only_windows
from vdet.labels.reading import read_labelled_images
from vdet.media.images import read_image
from vdet.synthetic import Renderer, Scene, true_boxes
from writing import write_image

FEW_WINDOWS = only_windows("size: 160, overlap: 0.7, top: 380, bottom: 600")


@pytest.fixture
def picture(scene: Scene, tmp_path: Path) -> Path:
    path = tmp_path / "in" / "road.png"
    path.parent.mkdir()
    write_image(path, Renderer(scene).image(10))
    return path


def test_without_an_output_the_vehicles_are_printed(
    run: Run, picture: Path, model_path: Path, scene: Scene
) -> None:
    options = ("--model", model_path, *QUICK_OPTIONS)
    result = run("detect-image", picture, *options, code=0)
    (item,) = json.loads(run("detect-image", picture, "--json", "-", *options).out)
    assert (item["image"], item["width"], item["height"]) == (str(picture), 320, 180)
    near = [true.box for true in true_boxes(scene, 10) if true.box.width > 20]
    middles = [box["x"] + box["width"] / 2 for box in item["boxes"]]
    assert any(abs(x - true.center[0]) < true.width for x in middles for true in near)
    title, *rows = result.out.splitlines()
    assert title.startswith(f"{picture}: {len(item['boxes'])} vehicle")
    for row, box in zip(rows, item["boxes"], strict=True):
        place = ", ".join(str(box[side]) for side in ("x", "y", "width", "height"))
        assert row == f"  vehicle  {box['score']:.2f}  {place}"


def test_in_a_folder_a_bad_picture_does_not_stop_the_others(
    run: Run, picture: Path, model_path: Path, tmp_path: Path
) -> None:
    (picture.parent / "a.png").write_text("text")
    write_image(picture.with_name("b.jpg"), read_image(picture))
    (picture.parent / "notes.txt").write_text("no picture")
    options = ("-o", tmp_path / "out", "--model", model_path, *FEW_WINDOWS)
    result = run("detect-image", picture.parent, *options)
    assert result.code == 3
    assert "a.png: is not an image, or is damaged" in result.err
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["b.jpg", "road.png"]
    alone = run("detect-image", picture.with_name("a.png"), "--json", "-")
    assert (alone.code, alone.out) == (1, ""), "if no picture works"


def test_labels_of_a_folder_and_those_below_are_read_by_eval_images(
    run: Run, picture: Path, model_path: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "set" / "images"
    (folder / "north").mkdir(parents=True)
    for name in ("a.png", "north/a.png"):
        (folder / name).write_bytes(picture.read_bytes())
    labels = tmp_path / "set" / "boxes.coco.json"
    options = ("--labels", labels, "--model", model_path, *QUICK_OPTIONS)
    run("detect-image", folder, *options, code=0)
    found = read_labelled_images(labels).images
    assert [item.path for item in found] == [folder / "a.png", folder / "north" / "a.png"]
    first, second = ([label.box for label in item.labels] for item in found)
    assert first
    assert first == second
