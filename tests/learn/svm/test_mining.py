"""Patches from a labelled video, for a detector that is no linear model."""

import re
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from vdet.boxes import NO_BOXES, Box, Boxes
from vdet.config.schema import MiningSettings, OutputSettings, Settings, TrainSettings
from vdet.errors import DataError, VideoError
from vdet.learn.svm.choosing import MOST, Most
from vdet.learn.svm.dataset import find_patches, read_patches
from vdet.learn.svm.mining import MiningJob, MiningResult, PictureSource, VideoSource, mine
from vdet.media import Frame, Picture, VideoInfo, VideoWriter
from vdet.media.images import Image, write_image

WIDTH, HEIGHT, FRAMES = 640, 360, 5
CAR = Box.sized(270, 190, 100, 70)
TREE = Box.sized(60, 190, 96, 70)  # what the detector takes for a vehicle
RED, GREEN = (0, 0, 255), (0, 160, 0)
NAME = re.compile(r"(?:frame|picture)(\d{6})_x(-?\d+)_y(\d+)_s(\d{4})\.png")


def draw() -> Image:
    """Draw a red car and a green tree on a grey road."""
    image = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)
    for box, color in ((CAR, RED), (TREE, GREEN)):
        box.cut(image)[:] = color
    return image


@dataclass
class FixedBoxes:
    """A detector that returns the same boxes for every picture, whatever it shows."""

    detections: Boxes

    def for_video(self, width: int, height: int, images: Sequence[Image]) -> "FixedBoxes":
        assert all(image.shape == (height, width, 3) for image in images)
        return self

    def search(self, picture: Picture, index: int | None) -> Image:
        assert index is None, "mined frames are searched as still pictures"
        return picture.image

    def detect(self, candidates: Image) -> Boxes:
        assert candidates.dtype == np.uint8
        return self.detections

    def stage_pictures(self, image: Image, detections: Boxes) -> dict[str, Image]:  # noqa: ARG002
        return {}


def found(*boxes: Box, score: float = 0.9) -> Boxes:
    corners = [(box.x1, box.y1, box.x2, box.y2) for box in boxes]
    return Boxes(corners, [score] * len(boxes)) if boxes else NO_BOXES


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("clip") / "road.mp4"
    rate = Fraction(25)
    info = VideoInfo(path, WIDTH, HEIGHT, rate, 1 / rate, frames=FRAMES)
    with VideoWriter(path, info, OutputSettings(crf=1)) as writer:
        for index in range(FRAMES):
            writer.write(Frame(index, index / rate, Picture(draw())))
    return path


Mine = Callable[..., MiningResult]


@pytest.fixture
def mined(clip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Mine:
    """Mine the clip, in which the truth has the car, with a detector that finds these boxes."""
    truth = tmp_path / "gt.txt"
    box = f"{CAR.x1 + 1},{CAR.y1 + 1},{CAR.width},{CAR.height}"
    truth.write_text("".join(f"{number},1,{box},1,3,1\n" for number in range(1, FRAMES + 1)))

    def run(
        *boxes: Box,
        score: float = 0.9,
        detector: type[FixedBoxes] = FixedBoxes,
        probability: float = 0.2,
        **most: int,
    ) -> MiningResult:
        model = detector(found(*boxes, score=score))
        job = MiningJob((VideoSource(clip, truth, every=2),), tmp_path / "mined.zip")
        monkeypatch.setattr("vdet.learn.svm.mining.MOST", Most(**most))
        settings = Settings(train=TrainSettings(mine=MiningSettings(probability=probability)))
        return mine(job, settings, model)

    return run


def boxes_of(archive: Path, group: str) -> list[Box]:
    """Return the windows of a group of patches, from their names."""
    boxes = []
    with zipfile.ZipFile(archive) as file:
        for name in file.namelist():
            if name.startswith(f"{group}/") and (match := NAME.search(name)):
                _, x, y, side = map(int, match.groups())
                boxes.append(Box.sized(x, y, side, side))
    return boxes


def test_windows_on_a_wrong_detection_are_false_alarms_and_those_on_the_truth_vehicles(
    mined: Mine, tmp_path: Path
) -> None:
    result = mined(CAR, TREE)
    assert result.frames == 3
    assert result.vehicles > 0
    assert result.false_alarms > 0
    assert result.parts == 0
    archive = tmp_path / "mined.zip"
    for box in boxes_of(archive, "vehicles/mined_road"):
        assert box.iou(CAR) > 0.35
        assert box.intersection(TREE).area == 0
    for box in boxes_of(archive, "non-vehicles/mined_road"):
        assert box.iou(TREE) > 0.35
        assert box.intersection(CAR).area == 0
    for patch in read_patches(find_patches([archive])):
        assert patch.image is not None
        _, green, red = patch.image[32, 32].tolist()
        if patch.file.name.startswith("non-vehicles"):
            assert green > red + 40, "the middle of a false alarm shows the tree"
        elif patch.file.name.startswith("vehicles"):
            assert red > green + 100, "the middle of a vehicle shows the car"


def test_a_detection_below_the_least_probability_is_no_false_alarm(mined: Mine) -> None:
    assert mined(TREE, score=0.3, probability=0.4).false_alarms == 0


def test_a_detection_of_a_part_of_a_vehicle_gives_parts(mined: Mine, tmp_path: Path) -> None:
    part = Box.sized(CAR.x1 + 34, CAR.y1 + 20, 32, 24)
    result = mined(part)
    assert result.parts > 0
    assert result.false_alarms == 0
    for box in boxes_of(tmp_path / "mined.zip", "non-vehicles/mined_road_parts"):
        assert CAR.contains(box.center)
        assert box.width < CAR.width / 2


def test_nothing_found_and_nothing_wanted_is_an_error(mined: Mine, tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"road\.mp4: no window fits a vehicle or is a false alarm"):
        mined(per_vehicle=0)
    assert not (tmp_path / "mined.zip").exists()


class Remembers(FixedBoxes):
    """A detector that finds nothing from its second picture on."""

    def for_video(self, width: int, height: int, images: Sequence[Image]) -> "Remembers":  # noqa: ARG002
        return Remembers(self.detections)

    def detect(self, candidates: Image) -> Boxes:  # noqa: ARG002
        detections, self.detections = self.detections, NO_BOXES
        return detections


def test_every_frame_is_searched_for_itself(mined: Mine) -> None:
    assert mined(TREE, detector=Remembers, false_alarms=1).false_alarms == 3


def test_frames_too_small_for_any_window_are_an_error_with_the_name_of_the_video(
    tmp_path: Path,
) -> None:
    source, truth = tmp_path / "tiny.mp4", tmp_path / "gt.txt"
    info = VideoInfo(source, 8, 8, rate := Fraction(25), 1 / rate, frames=1)
    with VideoWriter(source, info, OutputSettings()) as writer:
        writer.write(Frame(0, Fraction(0), Picture(np.zeros((8, 8, 3), np.uint8))))
    truth.write_text("1,1,1,1,4,4,1,3,1\n")
    job = MiningJob((VideoSource(source, truth),), tmp_path / "mined.zip")
    with pytest.raises(VideoError, match=r"tiny\.mp4: no window fits into a frame of 8×8 pixels"):
        mine(job, Settings(), FixedBoxes(NO_BOXES))
    assert not (tmp_path / "mined.zip").exists()


class TestPictures:
    """Labelled pictures: a folder in YOLO form, with the car in it."""

    @pytest.fixture
    def folder(self, tmp_path: Path) -> Path:
        folder = tmp_path / "city"
        for name in ("images", "labels"):
            (folder / name).mkdir(parents=True)
        write_image(folder / "images" / "a.png", draw())
        middle = CAR.center[0] / WIDTH, CAR.center[1] / HEIGHT
        size = CAR.width / WIDTH, CAR.height / HEIGHT
        row = " ".join(f"{value:.6f}" for value in (*middle, *size))
        (folder / "labels" / "a.txt").write_text(f"0 {row}\n")
        (folder / "data.yaml").write_text("names: [car]\n")
        return folder

    def test_they_are_mined_like_the_frames_of_a_video(
        self, folder: Path, clip: Path, tmp_path: Path
    ) -> None:
        truth = tmp_path / "gt.txt"
        box = f"{CAR.x1 + 1},{CAR.y1 + 1},{CAR.width},{CAR.height}"
        truth.write_text(f"1,1,{box},1,3,1\n")
        sources = (PictureSource(folder), VideoSource(clip, truth))
        job = MiningJob(sources, tmp_path / "mined.zip")
        result = mine(job, Settings(), FixedBoxes(found(TREE)))
        assert result.frames == 2
        for kind in ("vehicles", "non-vehicles"):
            boxes = boxes_of(job.output, f"{kind}/mined_city")
            assert boxes == boxes_of(job.output, f"{kind}/mined_road") != []

    def test_without_a_detector_windows_without_a_vehicle_are_taken(
        self, folder: Path, tmp_path: Path
    ) -> None:
        job = MiningJob((PictureSource(folder),), tmp_path / "mined.zip")
        result = mine(job, Settings(), None)
        assert result.vehicles > 0
        assert result.false_alarms == MOST.false_alarms
        for box in boxes_of(job.output, "non-vehicles/mined_city"):
            assert box.iou(CAR) < 0.5

    def test_two_sources_of_one_name_are_refused(self, folder: Path, tmp_path: Path) -> None:
        job = MiningJob((PictureSource(folder), PictureSource(folder)), tmp_path / "mined.zip")
        with pytest.raises(DataError, match="2 sources are named city; rename them"):
            mine(job, Settings(), None)
