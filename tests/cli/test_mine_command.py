"""`vdet mine`."""

import re
import zipfile
from collections import Counter
from pathlib import Path

import cv2
import numpy as np
import pytest

from conftest import Run
from labels.writers import exported
from vdet.detect.svm.model import load_model
from vdet.labels.label import boxes_of
from vdet.labels.reading import read_truth
from vdet.learn.svm.patches import find_patches, read_patches
from vdet.media.reader import VideoReader

SETS = ", ".join(
    f"{{size: {size}, overlap: 0.875, top: {top}, bottom: {bottom}}}"
    for size, top, bottom in ((40, 400, 500), (80, 380, 520), (160, 360, 600))
)
WINDOWS = (
    *("--set", "detector.search.perspective.sizes=[]"),
    *("--set", f"detector.search.windows=[{SETS}]"),
)
NAME = re.compile(r"frame(\d{6})_x(-?\d+)_y(\d+)_s(\d{4})\.png")


@pytest.fixture
def options(model_path: Path) -> tuple[str | Path, ...]:
    return ("--model", model_path, *WINDOWS)


def test_mines_patches_that_train_learns_from(
    run: Run,
    clip_path: Path,
    truth_path: Path,
    patches_path: Path,
    options: tuple[str, ...],
    tmp_path: Path,
) -> None:
    target, model_path = tmp_path / "mined.zip", tmp_path / "m.npz"
    result = run("mine", clip_path, "--truth", truth_path, "-o", target, *options, code=0)
    files = find_patches([target])
    counts = Counter(file.group for file in files)
    assert set(counts) == {
        "vehicles/mined_road",
        "boxes/mined_road",
        "non-vehicles/mined_road",
        "non-vehicles/mined_road_parts",
    }
    assert result.out == (
        f"{target}: {counts['vehicles/mined_road']} patches of vehicles, "
        f"{counts['boxes/mined_road']} more for their boxes, "
        f"{counts['non-vehicles/mined_road']} false alarms, "
        f"{counts['non-vehicles/mined_road_parts']} more on parts of vehicles; from 3 frames\n"
    )
    quick = ("--jobs", "1")
    learnt = run("train", patches_path, target, "-o", model_path, *quick, code=0)
    for group, count in counts.items():
        assert re.search(rf"{group} +{count} patches", learnt.out)
    model = load_model(model_path)
    assert model.box_regression is not None
    assert model.provenance["report"]["groups"]["boxes/mined_road"] == counts["boxes/mined_road"]


def test_a_patch_is_its_window_and_its_box_is_that_of_the_truth(
    run: Run, clip_path: Path, truth_path: Path, options: tuple[str, ...], tmp_path: Path
) -> None:
    target = tmp_path / "mined.zip"
    run("mine", clip_path, "--truth", truth_path, "-o", target, *options, code=0)
    with VideoReader(clip_path) as reader:
        frames = [frame.image for frame in reader]
    labels = read_truth(truth_path).frames
    seen = set()
    files = find_patches([target])
    for file, image in zip(files, read_patches(files), strict=True):
        match = NAME.fullmatch(file.name.rpartition("/")[2])
        assert match
        number, x, y, side = map(int, match.groups())
        seen.add(number)
        crop = frames[number - 1][y : y + side, x : x + side]
        expected = cv2.resize(crop, (64, 64), interpolation=cv2.INTER_LINEAR)
        np.testing.assert_array_equal(image, expected)
        if file.sides is not None:
            corners = boxes_of(label for label in labels[number - 1] if not label.ignored)
            middle = np.array([x, y, x, y]) + side / 2
            told = np.array(file.sides, float) * side + middle
            misses = np.nanmax(abs(corners - told), axis=1)
            assert misses.min() < 0.05
    assert seen == {1, 5, 9}


def test_a_frame_gives_the_same_patches_whatever_other_frames_are_used(
    run: Run, clip_path: Path, truth_path: Path, options: tuple[str, ...], tmp_path: Path
) -> None:
    for name, chosen in (
        ("a.zip", ()),
        ("b.zip", ()),
        ("c.zip", ("--from", "5", "--until", "8")),
        ("d.zip", ("--every", "1", "--from", "5", "--until", "6")),
    ):
        wanted = ("--truth", truth_path, "-o", tmp_path / name, *options, *chosen)
        run("mine", clip_path, *wanted, code=0)
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()
    whole, fifth, both = (_patches(tmp_path / f"{name}.zip") for name in "acd")
    assert fifth == {name: data for name, data in whole.items() if "frame000005" in name}
    assert {name: data for name, data in both.items() if "frame000005" in name} == fifth
    assert any("frame000006" in name for name in both)


def test_only_frames_that_the_truth_is_about_are_used(
    run: Run, clip_path: Path, options: tuple[str, ...], tmp_path: Path
) -> None:
    truth, target = tmp_path / "task.json", tmp_path / "mined.zip"
    truth.write_bytes(exported({1: [1], 4: [1], 7: [1]}, bbox=[100, 101, 30, 25]))
    wanted = ("--truth", truth, "-o", target, "--every", "1")
    result = run("mine", clip_path, *wanted, *options, code=0)
    assert result.out.endswith("from 3 frames\n")
    assert {int(name.partition("/frame")[2][:6]) for name in _patches(target)} == {2, 5, 8}


def test_frames_that_cut_a_vehicle_off_are_used_too(
    run: Run, clip_path: Path, truth_path: Path, options: tuple[str, ...], tmp_path: Path
) -> None:
    truth, target = tmp_path / "cut.txt", tmp_path / "mined.zip"
    rows = ["3,99,1,101,30,25,1,3,1", "4,99,9,101,30,25,1,3,1", "5,99,291,101,30,25,1,3,1"]
    truth.write_text("\n".join([truth_path.read_text().strip(), *rows]) + "\n")
    result = run("mine", clip_path, "--truth", truth, "-o", target, *options, "--from", "2", code=0)
    assert result.out.endswith("from 4 frames\n")
    numbers = {int(name.partition("/frame")[2][:6]) for name in _patches(target)}
    assert numbers == {2, 3, 5, 6}


def _patches(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist() if name != "boxes.csv"}
