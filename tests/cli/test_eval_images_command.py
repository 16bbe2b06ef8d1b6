"""`vdet eval images`."""

import json
from pathlib import Path

import pytest

import vdet
from conftest import Run
from labels.writers import WRITERS, Boxed, Labelled, show
from red_cars import CAR, HEIGHT, PERSPECTIVE, WIDTH, red_finder, road
from vdet.config.loading import render_settings
from vdet.detect.svm.model import save_model

CAR_BOX = (CAR.x1, CAR.y1, CAR.width, CAR.height)


@pytest.fixture
def red(tmp_path: Path) -> tuple[str | Path, ...]:
    """The options for the detector of red cars."""
    save_model(red_finder(), tmp_path / "red.npz")
    (tmp_path / "red.yaml").write_text(render_settings(PERSPECTIVE), encoding="utf-8")
    return "-c", tmp_path / "red.yaml", "--model", tmp_path / "red.npz"


def write_set(folder: Path, form: str = "COCO", truth: str = "car") -> Path:
    """Write a picture with a red car and one without; both have a box, so one is missed."""
    boxes = (Boxed(truth, CAR_BOX), Boxed("cow", (0, 0, 9, 9)))
    WRITERS[form](
        folder, {"a": Labelled(WIDTH, HEIGHT, boxes), "b": Labelled(WIDTH, HEIGHT, boxes)}
    )
    show(next(folder.rglob("a.png")), road(CAR))
    show(next(folder.rglob("b.png")), road())
    return folder


@pytest.mark.parametrize("form", WRITERS)
def test_a_set_of_each_form_has_the_same_scores(
    run: Run, tmp_path: Path, red: tuple[str | Path, ...], form: str
) -> None:
    folder = write_set(tmp_path / "set", form)
    result = run("eval", "images", folder, *red, "--json", "-", code=0)
    values = json.loads(result.out)
    (source,) = values["sources"]
    assert (source["vehicles"], source["matches"], source["false_positives"]) == (2, 1, 0)
    assert (source["precision"], source["recall"]) == (1, 0.5)
    assert sum(source["not_vehicles"].values()) == 2


def test_the_boxes_that_count_are_those_that_detect_image_shows(
    run: Run, tmp_path: Path, red: tuple[str | Path, ...]
) -> None:
    folder = write_set(tmp_path / "set")
    shown = run("detect-image", folder / "a.png", folder / "b.png", "--json", "-", *red)
    boxes = [box for picture in json.loads(shown.out) for box in picture["boxes"]]
    measured = json.loads(run("eval", "images", folder, *red, "--json", "-").out)
    assert measured["mean"]["matches"] + measured["mean"]["false_positives"] == len(boxes) == 1
    assert boxes[0]["score"] >= measured["score"] == pytest.approx(PERSPECTIVE.svm.min_score_still)
    options = (*red, "--set", "detector.min_score_still=1", "--json", "-")
    assert json.loads(run("eval", "images", folder, *options).out)["mean"]["matches"] == 0


def test_what_is_found_of_a_class_that_is_left_out_is_no_false_alarm(
    run: Run, tmp_path: Path, red: tuple[str | Path, ...]
) -> None:
    folder = write_set(tmp_path / "set")
    options = (*red, "--set", "labels.roles.car=other", "--json", "-")
    (source,) = json.loads(run("eval", "images", folder, *options).out)["sources"]
    assert (source["vehicles"], source["matches"], source["false_positives"]) == (0, 0, 0)


def test_several_sets_a_table_and_a_page(
    run: Run, tmp_path: Path, red: tuple[str | Path, ...]
) -> None:
    sets = [write_set(tmp_path / "a_$x_{$ set"), write_set(tmp_path / "two", "YOLO")]
    folder = tmp_path / "page"
    options = ("--page", folder, "--set", "detector.search.probability=0.6")
    result = run("eval", "images", *sets, *red, *options, code=0)
    first, second, *_ = result.out.splitlines()
    assert first.startswith(f"vdet {vdet.__version__}, detector svm, model red.npz, ")
    assert first.endswith("red.yaml detector.search.probability=0.6")
    assert second == f"boxes from score {PERSPECTIVE.svm.min_score_still:.2f}"
    for words in (str(sets[0]), str(sets[1]), "mean of 2", "cow (2)"):
        assert words in result.out
    assert "data:image/jpeg" in (folder / "page.html").read_text(encoding="utf-8")
