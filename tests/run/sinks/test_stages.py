"""The pictures of every stage of one moment."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from boxing import rounded
from red_cars import CAR, HEIGHT, SETTINGS, WIDTH, road
from run.red_runs import model_for, result_of, write
from run.sinks.test_overlay import LANE, LENS, road_seen
from vdet.boxes import Box, Boxes, Image
from vdet.errors import OutputError
from vdet.lanes.road import Lane, Road
from vdet.media.images import read_image
from vdet.run.sinks import Output
from vdet.run.steps import FrameResult

NAMES = [
    *("1-windows.png", "2-features.png", "3-hits.png", "4-heat.png", "5-threshold.png"),
    "6-boxes.png",
]


OTHER = Box.sized(200, 60, 48, 40)
LANES = "boxes", "tracks", "road", "above", "mask", "fit"


def detected(*boxes: Box, time: Fraction = Fraction(0), found: Road | None = None) -> FrameResult:
    """Return a result whose detections are those of the red car."""
    result = result_of(*boxes, time=time, found=found)
    detector = model_for(SETTINGS).for_video(WIDTH, HEIGHT, [result.frame.image])
    detections = detector.detect(detector.search(result.frame.picture, None))
    return replace(result, detections=detections)


def stages(folder: Path, at: Fraction, *results: FrameResult) -> list[str]:
    """Give results to the sink; return the names of the pictures that it leaves."""
    folder.mkdir(exist_ok=True)
    write(Output("stages", folder), results, at=at)
    return sorted(path.name for path in folder.iterdir())


def test_pictures_are_made_of_the_first_frame_at_or_after_the_moment(tmp_path: Path) -> None:
    early, late = (detected(time=Fraction(t)) for t in (1, 3))
    with pytest.raises(OutputError, match=r"red\.mp4: no frame at 2\.00 s or later"):
        stages(tmp_path / "a", Fraction(2), early)
    assert stages(tmp_path / "b", Fraction(2), early, late) == NAMES
    assert stages(tmp_path / "c", Fraction(3), early, late) == NAMES


@pytest.mark.parametrize("lane", [None, LANE])
def test_pictures_show_the_lane_where_it_is_looked_for(tmp_path: Path, lane: Lane | None) -> None:
    names = stages(tmp_path, Fraction(0), detected(found=replace(road_seen(LENS), lane=lane)))
    lanes = "07-road.png", "08-above.png", "09-mask.png", "10-fit.png"
    assert names == [*(f"0{name}" for name in NAMES), *lanes]


def test_a_detector_without_pictures_of_its_own_gets_that_of_the_boxes(tmp_path: Path) -> None:
    assert stages(tmp_path, Fraction(0), result_of(CAR)) == ["1-boxes.png", "2-tracks.png"]
    lane = result_of(CAR, found=road_seen(None))
    names = [f"{n}-{name}.png" for n, name in enumerate(LANES, start=1)]
    assert stages(tmp_path / "lanes", Fraction(0), lane) == names


def test_tracks_are_drawn_with_their_states_and_those_that_were_lost(tmp_path: Path) -> None:
    seen, lost = result_of(CAR, OTHER), result_of(CAR, time=Fraction(1))
    picture = tmp_path / stages(tmp_path, Fraction(1), seen, lost)[-1]
    drawn = read_image(picture).astype(int)
    edges = [Box(box.x1 + 4, box.y2 - 1, box.x2 - 4, box.y2).cut(drawn)[0] for box in (CAR, OTHER)]
    assert np.ptp(edges[0].max(axis=0)) > 50, "a colour of its own"
    assert edges[1].max(axis=0).tolist() == [160, 160, 160], "grey, dashed"
    assert len({tuple(pixel) for pixel in edges[1].tolist()}) > 1


def test_pictures_of_any_detector_come_first_in_its_order(tmp_path: Path) -> None:
    def pictures(image: Image, _: Boxes) -> dict[str, Image]:
        return {"z-first": image // 2, "a-second": 255 - image}

    write(Output("stages", tmp_path), [result_of()], stage_images=pictures)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        *("1-z-first.png", "2-a-second.png", "3-boxes.png")
    ]
    np.testing.assert_array_equal(read_image(tmp_path / "2-a-second.png"), 255 - road(CAR))


def test_detections_are_drawn_even_where_no_vehicle_is_shown(tmp_path: Path) -> None:
    result = detected()
    before = result.frame.image.copy()
    (box,) = rounded(result.detections)
    picture = read_image(tmp_path / stages(tmp_path, Fraction(0), result)[-1])
    assert (Box(box.x1, box.y1, box.x1 + 1, box.y2).cut(picture)[:, 0] == 255).all()
    np.testing.assert_array_equal(result.frame.image, before)
