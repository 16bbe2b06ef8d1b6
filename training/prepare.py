"""Write the sets to train on, without held-out images, and drawn roads: `prepare.py ROADS OUT`."""

import json
import sys
from collections.abc import Collection
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from benchmarks.crowds import crowd
from benchmarks.pole_cameras import HEIGHTS, KINDS, pole_scene
from benchmarks.unseen import deal

from vdet.config.schema import Settings
from vdet.labels.reading import Roles, read_labelled_images
from vdet.synthetic import Renderer, demo_scene, true_boxes

NEW = (
    *("bdd_empty_roads", "bdd_night", "bdd_rain", "bdd_trucks_day", "delhi_junctions"),
    *("gandhinagar_junctions", "india_web", "iran_footbridges", "kathmandu_tripureshwor"),
    *("mauritius_cctv", "poland_roadside", "roadside_signs", "sign_photos", "taiwan_rig"),
    *("ut_austin_night", "vehicle_photos"),
)
"""Sets of which every fifth camera is held out."""
FOLDS, HELD_OUT = 5, 2
WIDTH = 720
"""Width of a drawn image, pixels."""
LORRY_HEIGHT = 2.5  # metres; a higher body is a lorry's
HIDDEN = 0.75  # fraction of a vehicle; what is hidden further is an ignore region


def held_out(roads: Path) -> set[tuple[str, str]]:
    """Return the set and name of each held-out image."""
    roles = Roles.for_training(Settings())
    sets = [read_labelled_images(roads / name, roles) for name in NEW]
    return {
        (name, Path(image.path).name)
        for name, labelled, folds in zip(NEW, sets, deal(sets, FOLDS), strict=True)
        for image, fold in zip(labelled.images, folds, strict=True)
        if fold == HELD_OUT
    }


def write_part(folder: Path, target: Path, names: Collection[str]) -> None:
    """Write the labels of some images of a set, with links to the images."""
    data: dict[str, Any] = json.loads((folder / "annotations.json").read_text("utf-8"))
    images = [image for image in data["images"] if Path(image["file_name"]).name in names]
    if not images:
        return
    target.mkdir(parents=True)
    for image in images:
        (target / image["file_name"]).symlink_to(folder / image["file_name"])
    ids = {image["id"] for image in images}
    labels = [label for label in data["annotations"] if label["image_id"] in ids]
    part = {**data, "images": images, "annotations": labels}
    (target / "annotations.json").write_text(json.dumps(part), "utf-8")


def draw_roads(target: Path) -> None:
    """Draw images of scenes with seeds that no benchmark uses, and write their labels."""
    target.mkdir(parents=True)
    rng = np.random.default_rng(5)
    poles = [
        pole_scene(kind, above, seed) for kind in KINDS for above in HEIGHTS for seed in (11, 12)
    ]
    scenes = [(pole.scene, 3) for pole in poles] + [(crowd(n), 3) for n in range(1000, 1030)]
    scenes += [(demo_scene(seed), 5) for seed in range(900, 908)]
    images: list[dict[str, Any]] = []
    labels: list[dict[str, Any]] = []
    for scene, count in scenes:
        renderer, bodies = Renderer(scene), {item.id: item.body for item in scene.vehicles}
        for index in rng.choice(scene.frames, count, replace=False).tolist():
            image = renderer.image(index)
            factor = WIDTH / image.shape[1]
            size = WIDTH, round(image.shape[0] * factor)
            number = len(images) + 1
            name = f"{number:04d}.png"
            cv2.imwrite(str(target / name), cv2.resize(image, size, interpolation=cv2.INTER_AREA))
            images.append({"id": number, "file_name": name, "width": size[0], "height": size[1]})
            for true_box in true_boxes(scene, index):
                sides = [factor * value for value in true_box.box.xywh]
                is_lorry = bodies[true_box.id].height > LORRY_HEIGHT
                labels.append(
                    {
                        "id": len(labels) + 1,
                        "image_id": number,
                        "category_id": 2 if is_lorry else 1,
                        "bbox": sides,
                        "area": sides[2] * sides[3],
                        "iscrowd": int(true_box.hidden > HIDDEN),
                    }
                )
    classes = [{"id": 1, "name": "car"}, {"id": 2, "name": "truck"}]
    data = {"info": {}, "images": images, "annotations": labels, "categories": classes}
    (target / "annotations.json").write_text(json.dumps(data), "utf-8")


def main(roads: Path, output: Path) -> None:
    """Write the folders `train` and `held` into `output`."""
    held = held_out(roads)
    for folder in sorted(path for path in roads.iterdir() if path.is_dir()):
        names = {path.name for path in folder.iterdir()}
        kept_back = {name for name in names if (folder.name, name) in held}
        write_part(folder, output / "train" / folder.name, names - kept_back)
        write_part(folder, output / "held" / folder.name, kept_back)
    draw_roads(output / "train" / "drawn_roads")
    print(f"{len(held)} images are held out")


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve(), Path(sys.argv[2]))
