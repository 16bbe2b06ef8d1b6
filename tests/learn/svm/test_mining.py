"""Patches from labelled videos, where every window is a hit."""

import re
import zipfile
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from vdet.boxes import Box, Image
from vdet.config.schema import OutputSettings, Settings, SvmSettings
from vdet.detect.svm.detector import load_svm
from vdet.errors import DataError, VideoError
from vdet.learn.svm.choosing import Most
from vdet.learn.svm.dataset import find_patches, read_patches
from vdet.learn.svm.mining import VideoSource, mine
from vdet.media import Frame, Picture, VideoInfo
from vdet.media.writer import VideoWriter

WIDTH, HEIGHT, FRAMES = 640, 360, 5
CAR = Box.sized(270, 190, 100, 70)
TREE = Box.sized(60, 190, 96, 70)
RED, GREEN = (0, 0, 255), (0, 160, 0)
MODEL = load_svm(SvmSettings(), None)
SETTINGS = Settings()
EVERY = Most(probability=0)
NAME = re.compile(r"frame(\d{6})_x(-?\d+)_y(\d+)_s(\d{4})\.png")


def draw() -> Image:
    """Draw a red car and a green tree on a grey road."""
    image = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)
    for box, color in ((CAR, RED), (TREE, GREEN)):
        box.cut(image)[:] = color
    return image


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("clip") / "road.mp4"
    rate = Fraction(25)
    info = VideoInfo(path, WIDTH, HEIGHT, rate, 1 / rate, frames=FRAMES)
    with VideoWriter(path, info, OutputSettings(crf=1)) as writer:
        for index in range(FRAMES):
            writer.write(Frame(index, index / rate, Picture(draw())))
    return path


@pytest.fixture
def video(clip: Path, tmp_path: Path) -> VideoSource:
    """Return the clip with a truth that has the car."""
    truth = tmp_path / "gt.txt"
    box = f"{CAR.x1 + 1},{CAR.y1 + 1},{CAR.width},{CAR.height}"
    truth.write_text("".join(f"{number},1,{box},1,3,1\n" for number in range(1, FRAMES + 1)))
    return VideoSource(clip, truth, every=2)


def boxes_of(archive: Path, group: str) -> list[Box]:
    """Return the windows of a group of patches, from their names."""
    boxes = []
    with zipfile.ZipFile(archive) as file:
        for name in file.namelist():
            if name.startswith(f"{group}/") and (match := NAME.search(name)):
                _, x, y, side = map(int, match.groups())
                boxes.append(Box.sized(x, y, side, side))
    return boxes


def test_windows_on_the_truth_are_vehicles_and_others_false_alarms(
    video: VideoSource, tmp_path: Path
) -> None:
    archive = tmp_path / "mined.zip"
    frames, counts = mine([video], archive, SETTINGS, MODEL, most=EVERY)
    assert frames == 3
    for box in boxes_of(archive, "vehicles/mined_road"):
        assert box.iou(CAR) > 0.35
    for box in boxes_of(archive, "non-vehicles/mined_road"):
        assert box.iou(CAR) < 0.5
    vehicles = [file for file in find_patches([archive]) if file.group == "vehicles/mined_road"]
    assert len(vehicles) == counts["vehicle"] > 0
    for image in read_patches(vehicles):
        assert image is not None
        _, green, red = image[32, 32].tolist()
        assert red > green + 100, "the middle of a vehicle shows the car"


def test_nothing_wanted_is_an_error(video: VideoSource, tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"road\.mp4: no window shows a vehicle or a false alarm"):
        mine([video], tmp_path / "mined.zip", SETTINGS, MODEL, most=Most(0, 0, 0))
    assert not (tmp_path / "mined.zip").exists()


def test_frames_too_small_for_any_window_are_an_error_with_the_name_of_the_video(
    tmp_path: Path,
) -> None:
    source, truth = tmp_path / "tiny.mp4", tmp_path / "gt.txt"
    info = VideoInfo(source, 8, 8, rate := Fraction(25), 1 / rate, frames=1)
    with VideoWriter(source, info, OutputSettings()) as writer:
        writer.write(Frame(0, Fraction(0), Picture(np.zeros((8, 8, 3), np.uint8))))
    truth.write_text("1,1,1,1,4,4,1,3,1\n")
    with pytest.raises(VideoError, match=r"tiny\.mp4: no search window fits into 8×8"):
        mine([VideoSource(source, truth)], tmp_path / "mined.zip", SETTINGS, MODEL, most=EVERY)
    assert not (tmp_path / "mined.zip").exists()


def test_two_sources_of_one_name_are_refused(video: VideoSource, tmp_path: Path) -> None:
    with pytest.raises(DataError, match="2 sources are named road; rename them"):
        mine([video] * 2, tmp_path / "mined.zip", SETTINGS, MODEL, most=EVERY)
