"""`vdet review --export`: the checked vehicles as a set that `vdet train-net` reads."""

from pathlib import Path

import cv2
import numpy as np

from conftest import Run
from review_roads import CAR, GATE, HEIGHT, LINE_Y, SPEED, WIDTH, Car, draw_road
from vdet.config.schema import Settings
from vdet.labels.reading import read_labelled_images
from vdet.labels.roles import Roles
from vdet.learn.net.sources import image_source

CARS = [Car(3.05, 80), Car(3.05, 240, goes_up=False), Car(5, 100), Car(8, 80), Car(66, 240)]
SHAPES = GATE.partition("lines:")[2]
REVIEW = f"""\
video: in.mp4
size: [{WIDTH}, {HEIGHT}]
lines:{SHAPES}checked: [{{line: gate, start: 0.0, end: 60.0}}]
events:
  - {{line: gate, time: 3.0, direction: away, id: 1, error: class, correct: truck}}
  - {{line: gate, time: 5.0, direction: away, id: 3, error: false}}
  - {{line: gate, time: 6.0, direction: away, error: missed}}
"""


def test_checked_vehicles_are_labels_and_everything_else_is_ignored(
    run: Run, tmp_path: Path
) -> None:
    road = draw_road(tmp_path, CARS, seconds=68)
    review, output = tmp_path / "c.yaml", tmp_path / "set"
    review.write_text(REVIEW)
    saved = ("review", road.video, "--tracks-from", road.tracks, "-c", road.settings)
    export: tuple[object, ...] = (*saved, "--corrections", review, "--export", output)
    assert run(*export, code=0).out == f"{output}: written\n"
    settings = Settings()
    source = image_source(read_labelled_images(output, Roles.for_training(settings)), settings)
    assert source.vehicles == {"truck": 1, "vehicle": 2}
    both, alone = source.samples
    # MOTChallenge counts pixels from 1.
    for sample, lefts in ((both, [67, 227]), (alone, [67])):
        labelled = sample.boxes[~sample.ignored]
        assert labelled[:, 0].tolist() == lefts
        assert np.abs(labelled[:, 3] - LINE_Y).max() <= SPEED
        shown = np.zeros((HEIGHT, WIDTH), np.uint8)
        for left, top, right, bottom in labelled.astype(int).tolist():
            shown[top:bottom, left:right] = 1
            assert sample.image[top + 2 : bottom - 2, left + 2 : right - 2, 2].min() > 200
        ignored = np.zeros_like(shown)
        for box in sample.boxes[sample.ignored].astype(int).tolist():
            cv2.rectangle(ignored, box[:2], (box[2] - 1, box[3] - 1), 1, cv2.FILLED)
        assert np.array_equal(ignored, 1 - shown)
        assert shown.sum() == len(lefts) * CAR**2
    assert "already exists" in run(*export, code=1).err


def test_an_export_needs_checked_vehicles(run: Run, tmp_path: Path) -> None:
    road = draw_road(tmp_path, CARS[:1], seconds=4)
    review, output = tmp_path / "c.yaml", tmp_path / "set"
    review.write_text(REVIEW.partition("checked:")[0])
    saved = ("review", road.video, "--tracks-from", road.tracks, "-c", road.settings)
    export = (*saved, "--export", output)
    ended = run(*export, "--corrections", review, code=1)
    assert "c.yaml: no counted vehicle was checked" in ended.err
    for command in (saved, export, (*export, "--corrections", review, "-o", tmp_path / "page")):
        assert "pass -o, or --export and --corrections" in run(*command, code=2).err
    assert not output.exists()
