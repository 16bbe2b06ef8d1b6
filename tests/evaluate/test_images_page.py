"""The page on pictures: its contents, not its looks."""

from pathlib import Path

import numpy as np

from labels.writers import Boxed, Labelled, write_coco
from vdet.boxes import Boxes
from vdet.evaluate.images import Counting, ImagesResult, MeasuredImage, mean_scores, score_source
from vdet.evaluate.output import RunName
from vdet.evaluate.show_images import images_page, worst_tiles
from vdet.evaluate.tiles import FOUND, TRUE
from vdet.labels.label import from_size
from vdet.labels.reading import read_labelled_pictures

COUNTING = Counting(0.5, 0.0)
CAR = Boxed("car", (20, 10, 40, 30))


def result_of(folder: Path, *found: tuple[float, float, float, float]) -> ImagesResult:
    """Return the result where these boxes are found in each of two pictures, one without a car."""
    pictures = {
        "a": Labelled(100, 60, (CAR, Boxed("cow", (0, 0, 5, 5)))),
        "b": Labelled(100, 60),
    }
    labelled = read_labelled_pictures(write_coco(folder, pictures))
    boxes = np.array([from_size(*box) for box in found], np.float64).reshape(-1, 4)
    shown = Boxes(boxes, np.full(len(found), 0.9))
    measured = [MeasuredImage.of(each, 100, shown, COUNTING) for each in labelled.pictures]
    source = score_source(labelled, measured)
    return ImagesResult(COUNTING, (source,), mean_scores([source]))


def test_the_page_names_detector_source_and_labels_left_out(tmp_path: Path) -> None:
    folder = tmp_path / "a_$x_{$ set"
    html = images_page(result_of(folder, CAR.box), RunName("net", Path("x/my.onnx"), "net", ()))
    assert "detector net, model my.onnx, settings net; boxes from score 0.50" in html
    assert "not vehicles in" in html
    assert "cow (1)" in html


def test_a_page_where_nothing_is_found_can_be_made(tmp_path: Path) -> None:
    assert "<svg" in images_page(result_of(tmp_path), RunName("svm", None, None, ()))


def test_pictures_with_mistakes_are_shown_with_their_boxes(tmp_path: Path) -> None:
    result = result_of(tmp_path, (70, 10, 20, 30))
    first, second = worst_tiles(result.sources[0])
    assert (first.title, first.caption) == ("a.png", "1 missed, 1 false alarm")
    assert (second.title, second.caption) == ("b.png", "0 missed, 1 false alarm")
    for color in (TRUE, FOUND):
        assert np.any((first.image == color).all(axis=2))
