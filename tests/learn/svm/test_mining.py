"""Which windows become patches, what they show of a vehicle, and what cannot be mined."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from vdet.boxes import Box, from_xywh
from vdet.config.schema import Settings, SvmSettings
from vdet.detect.svm.detector import load_svm
from vdet.detect.svm.windows import Windows
from vdet.errors import DataError
from vdet.learn.svm.mining import (
    ChosenWindow,
    MiningLimits,
    PatchKind,
    VideoSource,
    choose_windows,
    compare_windows,
    mine,
)
from vdet.synthetic import Scene, write_truth
from vdet.track.track import Track

WIDTH = 1000
CAR = Box.sized(400, 300, 100, 70)
OTHER = Box.sized(700, 300, 100, 70)
GENEROUS = MiningLimits(per_vehicle=1000, false_alarms=1000, parts=1000, probability=0.2)


def truth(*vehicles: Box, ignored: tuple[Box, ...] = ()) -> list[Track]:
    return [
        Track(0, box, 1.0, "detected", ignored=number >= len(vehicles))
        for number, box in enumerate((*vehicles, *ignored))
    ]


def about(x: float, side: int = 100) -> Box:
    """Return a square window with this centre, as high as that of the vehicles."""
    return Box.sized(round(x - side / 2), round(335 - side / 2), side, side)


def windows(*boxes: Box) -> Windows:
    table: npt.NDArray[np.int32] = np.array(
        [(box.x1, box.y1, box.width, box.height) for box in boxes], np.int32
    )
    ones = np.ones(len(boxes), np.float32)
    return Windows(table, ones.copy(), ones, table.astype(np.float32))


def chosen(
    found: Windows, labels: list[Track], limits: MiningLimits = GENEROUS
) -> list[ChosenWindow]:
    rng = np.random.default_rng(0)
    return list(choose_windows(found, labels, WIDTH, rng, limits=limits))


def kinds(choices: list[ChosenWindow]) -> dict[Box, str]:
    return {choice.box: choice.kind for choice in choices}


def test_windows_become_patches_of_their_kind_if_they_are_probable_enough() -> None:
    fits, shows, part, false, sure = about(450), about(470), about(450, 36), about(100), about(200)
    found = windows(fits, shows, part, false, sure)
    every = {fits: "vehicle", shows: "box", part: "part", false: "false alarm", sure: "false alarm"}
    assert kinds(chosen(found, truth(CAR))) == every
    found.probabilities[:] = [0, 0, 0.19, 0.19, 0.21]
    choices = chosen(found, truth(CAR))
    assert kinds(choices) == {fits: "vehicle", shows: "box", sure: "false alarm"}
    assert {choice.box: choice.sides for choice in choices if choice.sides} == {
        fits: (-0.5, -0.35, 0.5, 0.35),
        shows: (-0.7, -0.35, 0.3, 0.35),
    }


def test_nothing_is_taken_from_ignore_regions() -> None:
    region = Box.sized(40, 280, 120, 120)
    inside, touching = about(100), about(185)
    for item, expected in ((inside, {}), (touching, {touching: "false alarm"})):
        assert kinds(chosen(windows(item), truth(ignored=(region,)))) == expected


def test_each_vehicle_and_the_frame_give_no_more_than_the_settings_allow() -> None:
    few = MiningLimits(per_vehicle=4, false_alarms=7, parts=3, probability=0)
    many = (about(x, side) for x in range(60, 940, 5) for side in (36, 80, 100, 120))
    choices = chosen(windows(*many), truth(CAR, OTHER), few)
    counted = [choice.kind for choice in choices]
    kinds_in_order: tuple[PatchKind, ...] = ("vehicle", "box", "false alarm", "part")
    assert [counted.count(kind) for kind in kinds_in_order] == [8, 8, 7, 3]
    fitting = [choice.box for choice in choices if choice.kind == "vehicle"]
    assert sum(box.x1 < 600 for box in fitting) == 4


VEHICLE = (400, 300, 100, 70)  # x, y, width, height


def window(side: float, x: float = 450) -> tuple[float, ...]:
    """Return a square window with this centre, as high as that of the vehicle."""
    return (x - side / 2, 335 - side / 2, side, side)


def flags(*windows: tuple[float, ...], vehicle: tuple[float, ...] = VEHICLE) -> str:
    """Return the flags that are set for each window as a word, "-" where none is."""
    (box,) = from_xywh(np.array([vehicle]))
    found = compare_windows(from_xywh(np.array(windows)), box, WIDTH)
    words = []
    for i in range(len(windows)):
        values = {"fits": found.fits[i], "shows": found.shows[i], "part": found.part[i]}
        words.append("+".join(name for name, on in values.items() if on) or "-")
    return " ".join(words)


def test_a_window_fits_a_vehicle_about_as_wide_as_itself() -> None:
    assert flags(*map(window, (34, 39, 41, 53))) == "part part shows+part shows+part"
    assert flags(*map(window, (55, 70, 80, 100, 135))) == "shows shows fits fits fits"
    assert flags(*map(window, (150, 170, 245, 255))) == "shows shows shows -"


RIGHT = (900, 300, 100, 70)  # its right side is beyond the frame
LEFT = (0, 300, 100, 70)


def test_a_window_fits_a_cut_off_vehicle_by_its_visible_side_and_its_height() -> None:
    side = 140
    windows = [window(side, 900 + fraction * side) for fraction in (0.1, 0.25, 0.45, 0.6, 0.7, 0.9)]
    assert flags(*windows, vehicle=RIGHT) == "- shows fits fits shows -"
    mirrored = [
        window(side, 100 - fraction * side) for fraction in (0.1, 0.25, 0.45, 0.6, 0.7, 0.9)
    ]
    assert flags(*mirrored, vehicle=LEFT) == "- shows fits fits shows -"
    sizes = [window(side, 900 + 0.45 * side) for side in (60, 78, 100, 150, 190, 300)]
    assert flags(*sizes, vehicle=RIGHT) == "- shows fits fits shows -"


MODEL = load_svm(SvmSettings(), None)


@pytest.fixture
def video(clip_path: Path, scene: Scene, tmp_path: Path) -> VideoSource:
    write_truth(tmp_path / "gt.txt", replace(scene, frames=5))
    return VideoSource(clip_path, tmp_path / "gt.txt", every=2)


@pytest.mark.parametrize(
    ("count", "limits", "words"),
    [
        (1, MiningLimits(0, 0, 0), r"road\.mp4: no window shows a vehicle or a false alarm"),
        (2, MiningLimits(probability=0), "2 sources are named road; rename them"),
    ],
)
def test_what_cannot_be_mined_is_an_error_and_leaves_nothing(
    count: int, limits: MiningLimits, words: str, video: VideoSource, tmp_path: Path
) -> None:
    with pytest.raises(DataError, match=words):
        mine([video] * count, tmp_path / "mined.zip", Settings(), MODEL, limits=limits)
    assert not (tmp_path / "mined.zip").exists()
