"""What a training reads into memory: frames of labelled video."""

import json
from pathlib import Path

import pytest

from labels.writers import Boxed, Labelled, write_coco
from strange.test_numbered_images import write_pictures
from vdet.config.schema import InputSettings, Settings
from vdet.errors import VideoError
from vdet.labels.reading import Roles, read_labelled_images
from vdet.learn.net.sources import UNLABELLED, clip_source, image_source


def test_a_damaged_video_is_learnt_from_as_far_as_the_settings_tolerate(tmp_path: Path) -> None:
    clip, truth = write_pictures(tmp_path / "%d.png", range(12)), tmp_path / "gt.txt"
    truth.write_text("".join(f"{frame},1,20,30,60,40,1,-1,-1,-1\n" for frame in range(1, 13)))
    for number in (5, 6):
        (tmp_path / f"{number}.png").write_text("no picture")
    tolerant = Settings(input=InputSettings(max_damaged=0.2))
    assert clip_source(clip, truth, tolerant).vehicles == {"car": 2}
    with pytest.raises(VideoError, match=r"2 of 12 frames .* more than input\.max_damaged"):
        clip_source(clip, truth, Settings())


def test_vehicles_of_a_labelled_video_keep_their_classes(tmp_path: Path) -> None:
    clip, truth = write_pictures(tmp_path / "%d.png", range(4)), tmp_path / "gt.csv"
    rows = [
        "1,5,5,20,20,1,detected,lorry",
        "2,30,5,20,20,1,detected,vehicle",
        "3,5,30,20,20,1,detected,",
        "4,40,40,20,20,1,detected,ignore",
    ]
    header = "frame,time,id,x,y,width,height,score,state,class"
    truth.write_text("\n".join([header, *(f"3,0.1,{row}" for row in rows)]))
    settings = Settings()
    source = clip_source(clip, truth, settings)
    (sample,) = source.samples
    classes = settings.train.net.classes
    truck, car = classes.index("truck"), classes.index("car")
    assert sample.classes.tolist() == [truck, UNLABELLED, car, UNLABELLED]
    assert source.ignored == {"vehicle": 1}


def test_a_class_without_labels_makes_the_picture_an_ignore_region_for_it(tmp_path: Path) -> None:
    scene = {
        "a": Labelled(160, 96, (Boxed("car", (20, 30, 60, 40)), Boxed("ignore", (0, 0, 9, 9))))
    }
    labels = write_coco(tmp_path, scene)
    document = json.loads(labels.read_text(encoding="utf-8"))
    document["info"]["unlabelled_classes"] = ["pedestrian"]
    labels.write_text(json.dumps(document), encoding="utf-8")
    settings = Settings()
    labelled = read_labelled_images(tmp_path, Roles.for_training(settings))
    source = image_source(labelled, settings)
    (sample,) = source.samples
    person = settings.train.net.classes.index("person")
    assert sample.boxes.tolist() == [[20, 30, 80, 70], [0, 0, 9, 9], [0, 0, 160, 96]]
    assert sample.classes.tolist() == [0, UNLABELLED, person]
    assert sample.ignored.tolist() == [False, True, True]
