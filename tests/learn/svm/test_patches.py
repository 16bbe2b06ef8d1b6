"""Patches in folders and zip files, and the samples made from them."""

import math
import os
import zipfile
from collections.abc import Callable, Iterable
from pathlib import Path

import cv2
import numpy as np
import pytest

from vdet.boxes import Image
from vdet.errors import DataError
from vdet.learn.svm.patches import (
    NO_SIDES,
    PatchSample,
    Sides,
    augment,
    cut_off,
    find_patches,
    mirrored,
    patch_archive,
    read_patches,
)

PATCH = np.random.default_rng(0).integers(0, 256, (8, 8, 3), dtype=np.uint8)
PNG = cv2.imencode(".png", PATCH)[1].tobytes()
Maker = Callable[[Path, Iterable[str]], Path]
BOTH = ["vehicles/far/1.png", "non-vehicles/road/1.png"]


def make_folder(folder: Path, names: Iterable[str]) -> Path:
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(PNG)
    return folder


def make_zip(path: Path, names: Iterable[str]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in names:
            archive.writestr(name, PNG)
    return path


def listed(source: Path) -> list[str]:
    return [file.name for file in find_patches([source])]


def test_a_folder_holds_both_classes_and_their_groups_in_numeric_order(tmp_path: Path) -> None:
    names = ["vehicles/far/10.png", "vehicles/far/2.png", "vehicles/left/1.png"]
    files = find_patches([make_folder(tmp_path, [*names, "non-vehicles/road/1.png"])])
    assert [(file.name, file.group, file.vehicle) for file in files] == [
        ("non-vehicles/road/1.png", "non-vehicles/road", False),
        ("vehicles/far/2.png", "vehicles/far", True),
        ("vehicles/far/10.png", "vehicles/far", True),
        ("vehicles/left/1.png", "vehicles/left", True),
    ]


def test_each_class_may_be_a_zip_file_of_its_own(tmp_path: Path) -> None:
    one = make_zip(tmp_path / "a.zip", ["vehicles/far/1.png"])
    other = make_zip(tmp_path / "b.zip", ["non-vehicles/road/1.png"])
    files = find_patches([one, other])
    assert [(file.source, file.vehicle) for file in files] == [(other, False), (one, True)]


@pytest.mark.parametrize("make", [make_folder, make_zip])
def test_other_files_than_patches_are_skipped(tmp_path: Path, make: Maker) -> None:
    junk = [
        "__MACOSX/vehicles/far/._1.png", "vehicles/far/._1.png", "vehicles/.DS_Store",
        "vehicles/far/notes.txt", "vehicles/.cache/1.png", "elsewhere/1.png", "Vehicles/1.png",
    ]  # fmt: skip
    assert listed(make(tmp_path / "set", [*BOTH, *junk])) == BOTH[::-1]


def test_a_broken_patch_has_no_image_and_the_others_are_read(tmp_path: Path) -> None:
    make_folder(tmp_path, [*BOTH, "vehicles/far/2.png", "vehicles/far/3.png"])
    (tmp_path / "vehicles/far/1.png").write_bytes(PNG[:30])
    (tmp_path / "vehicles/far/2.png").write_text("text")
    patches = list(read_patches(find_patches([tmp_path])))
    assert [image is None for image in patches] == [False, True, True, False]


def test_a_name_from_a_zip_file_is_shown_without_control_characters(tmp_path: Path) -> None:
    archive = make_zip(tmp_path / "set.zip", [*BOTH, "vehicles/far/\x1b[2J\n.png"])
    shown = [str(file) for file in find_patches([archive])]
    assert shown[2] == rf"{archive}: vehicles/far/\x1b[2J\n.png"


def test_devices_and_pipes_in_a_folder_are_no_patches(tmp_path: Path) -> None:
    make_folder(tmp_path, BOTH)
    os.mkfifo(tmp_path / "vehicles/far/2.png")
    (tmp_path / "vehicles/far/3.png").symlink_to("/dev/zero")
    assert listed(tmp_path) == BOTH[::-1]


BOXED = [*BOTH, "boxes/far/2.png", "boxes/far/1.png"]
ROWS = (
    "name,left,top,right,bottom",
    "vehicles/far/1.png,-0.5,-0.25,0.5,0.25",
    "boxes/far/1.png,-0.75,-0.25,,0.5",
    "boxes/far/2.png,,,,",
)


def with_table(tmp_path: Path, make: Maker, names: Iterable[str], *rows: str) -> Path:
    source = make(tmp_path / "mined", names)
    text = "\n".join(rows) + "\n"
    if source.is_dir():
        (source / "boxes.csv").write_text(text)
    else:
        with zipfile.ZipFile(source, "a", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("boxes.csv", text)
    return source


@pytest.mark.parametrize("make", [make_folder, make_zip])
def test_a_table_has_the_sides_of_the_vehicle_in_a_patch(tmp_path: Path, make: Maker) -> None:
    source = with_table(tmp_path, make, BOXED, *ROWS)
    files = find_patches([source])
    assert [(file.name, file.vehicle, file.is_boxed, file.sides) for file in files] == [
        ("boxes/far/1.png", True, True, pytest.approx((-0.75, -0.25, math.nan, 0.5), nan_ok=True)),
        ("boxes/far/2.png", True, True, pytest.approx(NO_SIDES, nan_ok=True)),
        ("non-vehicles/road/1.png", False, False, None),
        ("vehicles/far/1.png", True, False, (-0.5, -0.25, 0.5, 0.25)),
    ]


@pytest.mark.parametrize(
    "rows",
    [
        (),
        ("name,left,top,right",),
        ("vehicles/far/1.png,-0.5,-0.25,0.5,0.25",),
        (ROWS[0], "vehicles/far/1.png,-0.5,-0.25,0.5"),
        (ROWS[0], "vehicles/far/1.png,-0.5,-0.25,0.5,0.25,0"),
        (ROWS[0], "vehicles/far/1.png,-0.5,-0.25,0.5,wide"),
        (ROWS[0], ""),
    ],
)
@pytest.mark.parametrize("make", [make_folder, make_zip])
def test_a_damaged_table_is_refused(tmp_path: Path, make: Maker, rows: tuple[str, ...]) -> None:
    source = with_table(tmp_path, make, BOXED, *rows)
    with pytest.raises(DataError, match=r"mined: boxes\.csv is damaged .*; mine it again"):
        find_patches([source])


NAMES = ("vehicles/a/1.png", "boxes/a/2.png", "non-vehicles/a/3.png")
BOXES: tuple[Sides | None, ...] = ((-0.5, -0.25, 0.5, 0.12344), (math.nan, -0.25, 0.5, 0.0), None)


def patch(number: int) -> Image:
    return np.random.default_rng(number).integers(0, 256, (8, 8, 3), dtype=np.uint8)


def write_archive(path: Path) -> Path:
    with patch_archive(path) as add:
        for number, (name, sides) in enumerate(zip(NAMES, BOXES, strict=True)):
            add(name, patch(number), sides)
    return path


def test_an_archive_that_is_written_is_read_back(tmp_path: Path) -> None:
    path = write_archive(tmp_path / "a.zip")
    files = find_patches([path])
    assert {file.name: file.sides for file in files} == {
        NAMES[0]: (-0.5, -0.25, 0.5, 0.1234),
        NAMES[1]: pytest.approx(BOXES[1], nan_ok=True),
        NAMES[2]: None,
    }
    for file, image in zip(files, read_patches(files), strict=True):
        np.testing.assert_array_equal(image, patch(NAMES.index(file.name)))


def test_the_same_patches_give_the_same_bytes(tmp_path: Path) -> None:
    one, other = (write_archive(tmp_path / name) for name in ("a.zip", "b.zip"))
    assert one.read_bytes() == other.read_bytes()


NOISE = np.random.default_rng(0).integers(0, 256, (64, 64, 3), dtype=np.uint8)


def with_sides(*sides: float, vehicle: bool = True) -> PatchSample:
    return PatchSample(NOISE, vehicle, np.array(sides or (np.nan,) * 4, np.float32))


def augmented(
    monkeypatch: pytest.MonkeyPatch, seed: int, cut: float, part: float
) -> list[PatchSample]:
    monkeypatch.setattr("vdet.learn.svm.patches.CUT", cut)
    monkeypatch.setattr("vdet.learn.svm.patches.PART", part)
    return list(augment(with_sides(-0.5, -0.5, 0.5, 0.5), np.random.default_rng(seed)))


def test_a_mirror_image_flips_the_picture_and_its_box() -> None:
    sample = mirrored(with_sides(-0.4, -0.3, 0.2, 0.1))
    np.testing.assert_array_equal(sample.image, NOISE[:, ::-1])
    np.testing.assert_allclose(sample.sides, [-0.2, -0.3, 0.4, 0.1], rtol=1e-6)


@pytest.mark.parametrize("vehicle", [True, False])
def test_a_cut_repeats_the_outermost_column_that_is_left(vehicle: bool) -> None:
    right = cut_off(with_sides(vehicle=vehicle), 0.25, left=False)
    np.testing.assert_array_equal(right.image[:, :48], NOISE[:, :48])
    np.testing.assert_array_equal(right.image[:, 48:], np.repeat(NOISE[:, 47:48], 16, axis=1))
    left = cut_off(with_sides(vehicle=vehicle), 0.25, left=True)
    np.testing.assert_array_equal(left.image[:, 16:], NOISE[:, 16:])
    np.testing.assert_array_equal(left.image[:, :16], np.repeat(NOISE[:, 16:17], 16, axis=1))
    assert right.vehicle is left.vehicle is vehicle


def test_a_side_beyond_the_cut_becomes_unknown() -> None:
    whole = with_sides(-0.4, -0.3, 0.2, 0.1)
    for sample, unknown in (
        (cut_off(whole, 0.375, left=False), [False, False, True, False]),
        (cut_off(whole, 0.25, left=False), [False] * 4),
        (cut_off(whole, 0.25, left=True), [True, False, False, False]),
    ):
        np.testing.assert_array_equal(np.isnan(sample.sides), unknown)
        np.testing.assert_array_equal(
            sample.sides[~np.isnan(sample.sides)], whole.sides[~np.array(unknown)]
        )


def test_the_other_samples_are_made_of_the_patch_and_of_its_mirror_image(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    mirror, *others = augmented(monkeypatch, 0, cut=1, part=1)
    np.testing.assert_array_equal(mirror.image, NOISE[:, ::-1])
    assert [sample.vehicle for sample in others] == [True, False, True, False]
    assert len(augmented(monkeypatch, 0, cut=0, part=0)) == 1
