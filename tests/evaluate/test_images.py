"""Labelled pictures searched: red cars on grey, which the model is sure of."""

from pathlib import Path

import pytest

from boxing import moved_to
from labels.writers import Boxed, Labelled, show, write_coco
from red_cars import CAR, HEIGHT, PERSPECTIVE, WIDTH, red_finder, road
from vdet.boxes import Box
from vdet.detect.svm.detector import SvmModel
from vdet.errors import ImageError
from vdet.evaluate.results import Counting, evaluate_images
from vdet.labels.images import LabelledImages
from vdet.labels.reading import read_labelled_images

DETECTOR = PERSPECTIVE.svm
COUNTING = Counting(DETECTOR.min_score_still, 0)


@pytest.fixture
def model() -> SvmModel:
    return SvmModel(red_finder(), DETECTOR.showing_all())


@pytest.fixture
def red_set(tmp_path: Path) -> LabelledImages:
    """Five pictures with a car in other places, and one without."""
    cars = {f"{n}": moved_to(CAR, 30 + 40 * n, CAR.y1) for n in range(5)}
    return write_set(tmp_path / "red", cars | {"9": None})


def write_set(folder: Path, cars: dict[str, Box | None]) -> LabelledImages:
    pictures = {
        name: Labelled(
            WIDTH,
            HEIGHT,
            () if car is None else (Boxed("car", (car.x1, car.y1, car.width, car.height)),),
        )
        for name, car in cars.items()
    }
    path = write_coco(folder, pictures)
    for name, car in cars.items():
        show(folder / f"{name}.png", road(*([car] if car else [])))
    return read_labelled_images(path)


def test_results_do_not_depend_on_threads(red_set: LabelledImages, model: SvmModel) -> None:
    done: list[int] = []
    alone = evaluate_images([red_set], model, COUNTING, progress=lambda *_: done.append)
    together = evaluate_images([red_set], model, COUNTING, threads=3)
    assert done == [1] * 6
    assert alone[0].scores == together[0].scores
    assert alone[0].scores.matches > 0


def test_a_picture_that_cannot_be_read_is_named(red_set: LabelledImages, model: SvmModel) -> None:
    red_set.images[2].path.write_bytes(b"no picture")
    with pytest.raises(ImageError, match=r"2\.png: is not an image"):
        evaluate_images([red_set], model, COUNTING, threads=2)
