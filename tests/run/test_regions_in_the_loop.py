"""Regions in videos and pictures: which vehicles are shown, and the picture of the regions."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from boxing import moved_to, rounded
from red_cars import CAR, PERSPECTIVE, SETTINGS, WIDTH, drive, road
from run.red_runs import follow, model_for, outputs, run_red
from vdet.batch import result_digest
from vdet.boxes import Box
from vdet.config.schema import Settings
from vdet.errors import ImageError, VideoError
from vdet.files import OutputFiles
from vdet.media.images import read_image
from vdet.run.images import ImageJob, ImageSearch, run_images
from vdet.run.sinks import Output
from vdet.run.video import Run
from writing import write_image

RIGHT = [[100 / 320, 0], [1, 0], [1, 1], [100 / 320, 1]]


def within(settings: Settings = SETTINGS, **region: Any) -> Settings:
    shape = {"points": RIGHT} if "mask" not in region else {}
    regions = Settings.model_validate({"regions": [{"name": "right"} | shape | region]}).regions
    return settings.model_copy(update={"regions": regions})


def test_a_vehicle_is_shown_from_where_its_foot_is_in_the_region() -> None:
    whole = {r.frame.index: r.tracks for r in follow(drive(60))}
    results = list(follow(drive(60), within()))
    part = {r.frame.index: r.tracks for r in results}
    assert all(detection.box.foot[0] >= 100 for r in results for detection in r.detections)
    for index, tracks in whole.items():
        assert [t.box for t in part[index]] == [t.box for t in tracks if t.foot[0] >= 100]
    assert any(whole.values())
    assert any(part.values())


@pytest.mark.parametrize("settings", [SETTINGS, PERSPECTIVE], ids=["outlines", "votes"])
def test_a_picture_shows_only_what_stands_in_the_region(settings: Settings) -> None:
    image = road(moved_to(CAR, 20, 120), moved_to(CAR, 220, 120))

    def found(regions: Settings) -> list[Box]:
        result = ImageSearch(model_for(regions), regions).detect(Path("a.png"), image)
        assert [t.box for t in result.tracks] == rounded(result.detections)
        return [t.box for t in result.tracks]

    assert len(found(settings)) == 2
    (right,) = found(within(settings=settings))
    (left,) = found(within(settings=settings, kind="exclude"))
    assert left.center[0] < WIDTH / 2 < right.center[0]


def test_regions_for_another_shape_name_the_file(red_clip: Path, tmp_path: Path) -> None:
    settings = within(size=(100, 100))
    with pytest.raises(VideoError, match=r"red\.mp4: camera\.size: points are for frames"):
        run_red(Run(red_clip, outputs(tracks=tmp_path / "t.csv")), settings)
    with pytest.raises(ImageError, match=r"a\.png: camera\.size"):
        ImageSearch(model_for(settings), settings).detect(Path("a.png"), road(CAR))
    assert list(tmp_path.iterdir()) == []


def test_the_stages_show_the_regions(tmp_path: Path) -> None:
    write_image(tmp_path / "road.png", road(CAR))
    for name, settings in (("without", SETTINGS), ("with", within())):
        folder = tmp_path / name
        job = ImageJob(tmp_path / "road.png", (Output("stages", folder),))
        list(run_images([job], (), ImageSearch(model_for(settings), settings), OutputFiles()))
    assert not list((tmp_path / "without").glob("*regions*"))
    names = sorted(path.name for path in (tmp_path / "with").iterdir())
    assert names[-2:] == ["6-regions.png", "7-boxes.png"]
    picture = read_image(tmp_path / "with" / "6-regions.png")
    assert picture[220, 40].max() < 60, "it is dark outside"
    assert np.array_equal(picture[220, 200], road(CAR)[220, 200])


def test_a_mask_that_is_drawn_anew_makes_results_out_of_date(tmp_path: Path) -> None:
    mask = tmp_path / "mask.png"
    run = Run(Path("a.mp4"), settings=within(Settings(), mask=str(mask)))
    write_image(mask, np.zeros((24, 32, 3), np.uint8))
    before = result_digest(run)
    assert before == result_digest(run)
    write_image(mask, np.full((24, 32, 3), 255, np.uint8))
    assert before != result_digest(run)
