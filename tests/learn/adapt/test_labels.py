"""Labels of what a teacher finds: sure where it was followed for long, doubtful else."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from vdet.config.schema import Settings
from vdet.detect.detections import Detections
from vdet.evaluate.labelled_video import LabelledVideo
from vdet.evaluate.truth import read_truth
from vdet.geometry import Box
from vdet.learn.adapt.labels import WatchedFrame, label, write_labels

WIDTH, HEIGHT, RATE = 1280, 720, 25
CAR, OTHER = Box(400, 400, 100, 70), Box(900, 420, 80, 60)
SETTINGS = Settings()

Scored = tuple[Box, float]


def watched(frames: Sequence[Sequence[Scored]]) -> list[WatchedFrame]:
    """Give what a teacher finds in consecutive frames."""
    return [
        WatchedFrame(
            number,
            number / RATE,
            Detections(
                [(box.x, box.y, box.right, box.bottom) for box, _ in found] or [],
                [score for _, score in found],
            ),
        )
        for number, found in enumerate(frames, start=1)
    ]


def labels(frames: Sequence[Sequence[Scored]]) -> LabelledVideo:
    return label(watched(frames), SETTINGS, WIDTH, HEIGHT)


def vehicles(made: LabelledVideo, number: int) -> list[list[float]]:
    frame = made.frame(number)
    return [list(map(float, box)) for box in frame.boxes[~frame.ignored]]


def regions(made: LabelledVideo, number: int) -> list[list[float]]:
    frame = made.frame(number)
    return [list(map(float, box)) for box in frame.boxes[frame.ignored]]


SIDES = [CAR.x, CAR.y, CAR.width, CAR.height]


def test_a_vehicle_is_labelled_from_its_first_frame_to_its_last() -> None:
    made = labels([[], *[[(CAR, 0.9)]] * 20, []])
    assert [len(vehicles(made, number)) for number in range(1, 23)] == [0, *[1] * 20, 0]
    assert vehicles(made, 1) == []
    assert vehicles(made, 2) == [SIDES]


def test_what_is_followed_for_long_is_trusted_where_it_is_weak() -> None:
    made = labels([[(CAR, 0.3 if 8 <= number < 12 else 0.9)] for number in range(20)])
    assert all(vehicles(made, number) == [SIDES] for number in range(1, 21))


def test_a_flicker_is_an_ignore_region() -> None:
    made = labels([[(OTHER, 0.6)] if number == 10 else [] for number in range(20)])
    assert len(made) == 1
    assert len(regions(made, 11)) == 1


def test_a_doubtful_box_that_is_hardly_seen_counts_as_background() -> None:
    faint = SETTINGS.adapt.doubtful - 0.01
    assert len(labels([[(OTHER, faint)] if number == 10 else [] for number in range(20)])) == 0


def test_where_a_followed_vehicle_is_missed_there_is_an_ignore_region() -> None:
    made = labels([[] if number in (9, 10) else [(CAR, 0.9)] for number in range(20)])
    assert vehicles(made, 10) == []
    (box,) = {tuple(each) for each in regions(made, 10)}
    assert Box(*map(round, box)).iou(CAR) > 0.9


def test_a_vehicle_that_is_too_narrow_is_an_ignore_region() -> None:
    narrow = Box(600, 360, int(SETTINGS.adapt.least_width * WIDTH) - 1, 25)
    made = labels([[(narrow, 0.9)]] * 20)
    assert vehicles(made, 10) == []


def test_no_frames_have_no_labels() -> None:
    assert len(labels([])) == 0


def test_written_labels_are_read_as_truth(tmp_path: Path) -> None:
    made = labels([[(CAR, 0.9), *([(OTHER, 0.6)] if number == 10 else [])] for number in range(20)])
    write_labels(made, tmp_path / "gt.txt")
    read = read_truth(tmp_path / "gt.txt")
    assert read.frames.tolist() == made.frames.tolist()
    assert read.ignored.tolist() == made.ignored.tolist()
    assert read.boxes == pytest.approx(made.boxes)
