"""What a training reads into memory: frames of labelled video."""

from pathlib import Path

import pytest

from strange.test_numbered_pictures import write_pictures
from vdet.config.schema import InputSettings, Settings
from vdet.errors import VideoError
from vdet.learn.net.sources import CLASSES, UNKNOWN, clip_source


def test_a_damaged_video_is_learnt_from_as_far_as_the_settings_tolerate(tmp_path: Path) -> None:
    clip, truth = write_pictures(tmp_path / "%d.png", range(12)), tmp_path / "gt.txt"
    truth.write_text("".join(f"{frame},1,20,30,60,40,1,-1,-1,-1\n" for frame in range(1, 13)))
    for number in (5, 6):
        (tmp_path / f"{number}.png").write_text("no picture")
    tolerant = Settings(input=InputSettings(max_damaged=0.2))
    assert clip_source(clip, truth, tolerant).report().vehicles == 2
    with pytest.raises(VideoError, match=r"2 of 12 frames .* more than input\.max_damaged"):
        clip_source(clip, truth, Settings())


def test_vehicles_of_a_labelled_video_keep_their_classes(tmp_path: Path) -> None:
    clip, truth = write_pictures(tmp_path / "%d.png", range(4)), tmp_path / "gt.csv"
    rows = ["1,5,5,20,20,1,seen,lorry", "2,30,5,20,20,1,seen,vehicle", "3,5,30,20,20,1,seen,"]
    header = "frame,time,id,x,y,width,height,score,state,class"
    truth.write_text("\n".join([header, *(f"3,0.1,{row}" for row in rows)]))
    (sample,) = clip_source(clip, truth, Settings()).samples
    assert sample.classes.tolist() == [CLASSES.index("truck"), UNKNOWN, CLASSES.index("car")]
