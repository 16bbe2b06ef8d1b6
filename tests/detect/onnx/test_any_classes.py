"""Networks of any number of classes work in every output."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from conftest import Run
from detect.onnx.graphs import RedBox, ultralytics, write_network
from running import write_images
from vdet.config.schema import NetworkSettings
from vdet.detect.onnx.detector import NetworkModel, class_numbers
from vdet.detect.onnx.network import COCO
from vdet.labels.reading import read_tracks
from vdet.media import Picture

SIZE = 256, 128
FORMATS = (".txt", ".csv", ".jsonl", ".coco.json")
GATE = "traffic: {lines: [{name: gate, start: [0.1, 0.5], end: [0.9, 0.5]}]}\n"


def network_for(path: Path, box: RedBox, names: Sequence[str]) -> Path:
    """Write a network of these classes that finds a box as red as the middle of its input."""
    metadata = {"task": "detect", "names": str(dict(enumerate(names))), "imgsz": "[64, 128]"}
    form = ultralytics((128, 64), box, len(names))
    return write_network(path, form, (128, 64), (64, 32), metadata=metadata)


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    """A second of a grey video with a red square in the middle."""
    image = np.full((SIZE[1], SIZE[0], 3), 60, np.uint8)
    image[48:80, 112:144] = 0, 0, 255
    return write_images(tmp_path / "in.mp4", [image] * 12, rate=12, crf=1)


@pytest.mark.parametrize("count", [2, 20])
def test_a_vehicle_of_any_class_is_in_every_output(
    run: Run, clip: Path, tmp_path: Path, count: int
) -> None:
    names = [f"kind {number}" for number in range(count)]
    network = network_for(tmp_path / "net.onnx", RedBox(64, 32, 16, 16, count - 1), names)
    (tmp_path / "gate.yaml").write_text(GATE)
    tracks = [tmp_path / f"found{suffix}" for suffix in FORMATS]
    outputs = ("vehicles.json", "vehicles.csv", "counts.csv", "flows.csv", "page", "crops")
    run(
        "detect-video", clip, tmp_path / "out.mp4", "-q", "--model", network,
        "--set", f"detector.classes={names}", "-c", tmp_path / "gate.yaml",
        *(item for path in tracks for item in ("--tracks", path)),
        *(item for name in outputs for item in (f"--{name.split('.')[0]}", tmp_path / name)), code=0
    )  # fmt: skip
    assert all((tmp_path / name).exists() for name in outputs)
    for path in tracks:
        assert read_tracks(path).frames, path
    assert names[-1] in (tmp_path / "vehicles.csv").read_text(encoding="utf-8")
    assert names[-1] in (tmp_path / "page" / "page.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("name", "x", "size", "is_shown"),
    [
        ("car", 64, (16, 28), True),  # 0.45 is enough for a car, but not for a truck
        ("truck", 64, (16, 16), False),
        ("motorcycle", 64, (14, 30), True),
        ("car", 64, (14, 30), False),  # more than 1.8 times as high as wide: a sign
        ("car", 7, (14, 30), True),  # a part of a car, as the left side of the image cuts it
        ("car", 4, (8, 44), False),  # not even a part: a tree
    ],
)
def test_the_minimum_score_of_an_image_and_the_maximum_height_depend_on_the_class(
    tmp_path: Path, name: str, x: int, size: tuple[int, int], is_shown: bool
) -> None:
    names = NetworkSettings().classes
    box = RedBox(x, 32, *size, names.index(name))
    network = network_for(tmp_path / "net.onnx", box, names)
    image = np.zeros((64, 128, 3), np.uint8)
    image[:, :, 2] = round(0.45 * 255)
    detector = NetworkModel(NetworkSettings(), network).for_video(128, 64, [])
    boxes = detector.detect(detector.search(Picture(image), None))
    assert boxes.class_names == [name] * is_shown


WANTED = ("car", "truck", "bus", "vehicle")


def test_names_of_others_are_taken_for_ours() -> None:
    names = ("Van", "lorry", "coach", "person", "vehicle", "trailer", "Two wheeler")
    assert class_numbers(names, WANTED) == [0, 1, 2, -1, 3, -1, -1]
    assert class_numbers(names, (*WANTED, "motorcycle"))[-1] == 4
    others = ("HGV", "LGV", "minibus", "Jeep", "ambulance", "auto", "E-Rickshaw", "tricycle")
    assert class_numbers(others, WANTED) == [1, 0, 2, 0, 0, 3, 3, 3]


def test_any_class_that_the_network_knows_may_be_wanted() -> None:
    numbers = class_numbers(COCO, ("traffic light", "car"))
    wanted = {name: number for name, number in zip(COCO, numbers, strict=True) if number >= 0}
    assert wanted == {"traffic light": 0, "car": 1}
