"""The sink `stages`: the detector's pictures, and one with the boxes, as numbered files."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from red_cars import CAR, SETTINGS, red_model, road
from vdet.boxes import Box
from vdet.files import OutputFiles
from vdet.media import Frame, Picture
from vdet.media.images import Image, read_image
from vdet.run.result import FrameResult
from vdet.run.sinks.protocol import SinkContext
from vdet.run.sinks.stages import StagesSink
from vdet.track.track import Track

NAMES = ["1-patches.png", "2-windows.png", "3-hits.png", "4-heat.png", "5-boxes.png"]


def result_of(image: Image, *tracks: Track) -> FrameResult:
    height, width = image.shape[:2]
    detector = red_model().for_video(width, height, [image])
    detections = detector.detect(detector.search(Picture(image), None))
    return FrameResult(
        Path("road.png"), Frame(0, Fraction(0), Picture(image)), detections, tracks, None, detector
    )


def written(folder: Path, result: FrameResult) -> dict[str, Image]:
    """Write the stages of a frame and read them again; name → picture."""
    folder.mkdir(parents=True, exist_ok=True)
    with (
        OutputFiles(overwrite=True) as files,
        StagesSink(folder, SinkContext(files, SETTINGS)) as sink,
    ):
        sink.write(result)
    return {path.name: read_image(path) for path in sorted(folder.iterdir())}


def track_of(box: Box) -> Track:
    return Track(1, box, score=0.9, predicted=False)


@pytest.mark.parametrize("image", [road(CAR), road()], ids=["a car", "nothing found"])
def test_all_five_are_written(tmp_path: Path, image: Image) -> None:
    result = result_of(image)
    pictures = written(tmp_path / "stages", result)
    assert list(pictures) == NAMES
    for name, picture in result.stage_pictures().items():
        (written_as,) = [each for each in NAMES if name in each]
        np.testing.assert_array_equal(pictures[written_as], picture)


def test_the_frame_itself_is_not_drawn_on(tmp_path: Path) -> None:
    result = result_of(road(CAR), track_of(CAR))
    written(tmp_path, result)
    np.testing.assert_array_equal(result.frame.image, road(CAR))


def test_where_nothing_is_found_the_frame_is_shown_as_it_is(tmp_path: Path) -> None:
    np.testing.assert_array_equal(written(tmp_path, result_of(road()))["5-boxes.png"], road())


def test_tracks_are_drawn_with_their_labels(tmp_path: Path) -> None:
    plain = written(tmp_path / "a", result_of(road()))["5-boxes.png"]
    boxed = written(tmp_path / "b", result_of(road(), track_of(CAR)))["5-boxes.png"]
    assert (boxed[CAR.y, CAR.x : CAR.right] != plain[CAR.y, CAR.x : CAR.right]).any(axis=1).all()
    assert (boxed[: CAR.y] != plain[: CAR.y]).any()


def test_detections_are_drawn_even_where_no_track_is_shown(tmp_path: Path) -> None:
    result = result_of(road(CAR))
    (box,) = result.detections.rounded
    picture = written(tmp_path, result)["5-boxes.png"]
    assert (picture[box.y : box.bottom, box.x] == 255).all()


def test_earlier_pictures_are_replaced(tmp_path: Path) -> None:
    written(tmp_path, result_of(road(CAR)))
    pictures = written(tmp_path, result_of(road()))
    assert list(pictures) == NAMES
    np.testing.assert_array_equal(pictures["3-hits.png"], road())
