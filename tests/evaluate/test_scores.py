"""Metrics: cases worked out by hand, and those of trackeval and pycocotools."""

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaluate.scenes import TEN, drive, video
from labels.saving import Row, checked_video, row
from vdet.boxes import Box, Boxes
from vdet.evaluate.results import Counting, MeasuredImage
from vdet.evaluate.scores import ClassResult, class_results, compare, pool, score, score_comparison
from vdet.labels.images import LabelledImage
from vdet.labels.label import NO_ID, SavedTracks
from vdet.track.track import Track


def test_two_empty_videos_have_scores_too() -> None:
    scores = score(video(), video())
    assert (scores.vehicles, scores.tracks, scores.f1, scores.hota) == (0, 0, 0, 0)


def test_the_delay_is_from_the_first_true_frame_to_the_first_match() -> None:
    places = (8, 5, 0.0), (9, 7, 300.0), (10, 5, 600.0)  # id, first frame, place
    truth = video(*(drive(id_, range(start, 20), x) for id_, start, x in places))
    found = video(drive(1, range(12, 20)), drive(2, range(7, 20), x=300), drive(3, TEN, x=900))
    scores = score(found, truth)
    assert (scores.delays, scores.mean_delay) == ((7, 0, None), 3.5)


@pytest.mark.parametrize(("on_vehicle", "false"), [(4, 1), (5, 0), (6, 0)])
def test_a_track_is_false_when_more_than_half_of_it_matches_nothing(
    on_vehicle: int, false: int
) -> None:
    track = drive(1, range(1, 1 + on_vehicle)) + drive(1, range(1 + on_vehicle, 11), x=300)
    assert score(video(track), video(drive(8, range(1, 11)))).false_tracks == false


PLACES = st.integers(0, 12).map(lambda step: step * 20.0)
SCENES = st.dictionaries(st.tuples(st.integers(1, 6), st.integers(1, 4)), PLACES, max_size=20).map(
    lambda boxes: video(*(drive(i, range(f, f + 1), x) for (f, i), x in boxes.items()))
)


@given(SCENES, SCENES)
def test_ratios_are_within_their_bounds(found: SavedTracks, truth: SavedTracks) -> None:
    scores = asdict(score(found, truth))
    ratios = ("precision", "recall", "f1", "ap50", "ap50_95", "idf1", "hota", "deta", "assa")
    assert all(0 <= scores[name] <= 1 + 1e-9 for name in ratios)
    assert scores["mota"] <= 1
    assert scores["matches"] + scores["misses"] == scores["vehicle_boxes"]
    assert scores["matches"] + scores["false_positives"] == scores["track_boxes"]


def box(id_: int, x: float, width: float = 100, frame: int = 1) -> Row:
    return row(0, frame, id_, x, 0, width, 100)


def region(x: float, width: float, id_: int = NO_ID) -> Row:
    return row(0, 1, id_, x, 0, width, 100, ignored=True)


IGNORED = [region(x, 100, id_) for id_, x in ((5, 0), (6, 300))]


@pytest.mark.parametrize(
    ("found", "truth", "kept"),
    [
        pytest.param([box(5, 300)], [region(250, 500)], [], id="in a region"),
        pytest.param([box(5, 149)], [region(200, 500)], [5], id="less than half in a region"),
        pytest.param([box(5, 100)], [region(0, 140), region(160, 140)], [5], id="in parts of two"),
        pytest.param([box(5, 300)], [box(1, 310), region(250, 500)], [5], id="finds a vehicle"),
        pytest.param(
            [box(5, 320), box(6, 300)], [box(1, 300), region(250, 500)], [6], id="the worse of two"
        ),
        pytest.param(IGNORED, [box(1, 10)], [5], id="itself ignored"),
    ],
)
def test_predictions_that_count_beside_ignore_regions(
    found: list[Row], truth: list[Row], kept: list[int]
) -> None:
    comparison = compare(video(found), video(truth))
    assert [int(comparison.track_ids[t]) for f in comparison.frames for t in f.tracks] == kept


GOOD = compare(video(drive(1, TEN)), video(drive(1, TEN)))
POOR = compare(video(drive(1, range(5, 10))), video(drive(1, TEN)))


def test_the_same_id_in_two_videos_is_two_vehicles() -> None:
    total = score_comparison(pool([GOOD, POOR]))
    assert (total.vehicles, total.tracks, total.id_switches) == (2, 2, 0)
    assert total.idf1 == pytest.approx(2 * 15 / (20 + 15))  # either track is right throughout
    assert total.delays == (0, 5)


def test_vehicles_of_a_picture_are_counted_by_their_class_and_that_of_their_detection() -> None:
    places, true = [(x, 0, x + 100, 100) for x in range(0, 800, 200)], ["car", "truck", "truck"]
    labels = [
        Track(0, Box(*box), 1.0, "detected", name)
        for box, name in zip(places, [*true, "vehicle"], strict=True)
    ]
    picture = LabelledImage(Path("a.png"), Path("a.txt"), tuple(labels))
    boxes = np.array([*places[:2], places[3], (900, 0, 999, 100)])
    found = Boxes(boxes, [0.9] * 4, classes=[0, 0, 1, 1], names=["car", "truck"])
    shown = MeasuredImage.of(picture, 1000, found, Counting(0.5, 0)).shown
    assert class_results(shown) == (
        ClassResult("car", 1, 1, 1, 0.5, 1, 2 / 3, {"car": 1}),
        ClassResult("truck", 2, 1, 0, 0, 0, 0, {"car": 1}),
    )


def named(name: str, *tracks: list[Row]) -> list[Row]:
    return [(index, replace(track, class_name=name)) for rows in tracks for index, track in rows]


def test_a_vehicle_of_a_video_has_the_last_class_of_the_track_that_finds_it_most() -> None:
    truth = video(named("Lorry", drive(7, TEN), drive(8, TEN, x=300), drive(9, TEN, x=600)))
    found = video(
        named("car", drive(1, range(3)), drive(3, TEN, x=900)),
        named("car", drive(2, range(4, 8))),
        named("truck", drive(2, range(8, 11))),
        named("bus", drive(4, TEN, x=300)),
    )
    truck = ClassResult("truck", 3, 2, 1, 1, 1 / 3, 0.5, {"truck": 1, "bus": 1})
    assert class_results(compare(found, truth)) == (truck,)


def test_there_is_no_table_where_tracks_have_no_class() -> None:
    truth = video(named("car", drive(7, TEN)))
    assert class_results(compare(video(drive(1, TEN)), truth)) == ()
    assert class_results(compare(replace(truth), video(drive(1, TEN)))) == ()


CASES = sorted(Path(__file__).parent.glob("golden/*.json"))


def load(path: Path) -> dict[str, Any]:
    case: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return case


def truth_of(case: dict[str, Any]) -> SavedTracks:
    rows = [
        row(0, frame, id_, x, y, width, height, ignored=ignored == 1)
        for frame, id_, x, y, width, height, ignored in case["truth"]
    ]
    return checked_video(rows)


def prediction_of(case: dict[str, Any]) -> SavedTracks:
    return checked_video([row(0, *values) for values in case["prediction"]])


def test_all_the_cases_are_there() -> None:
    assert len(CASES) == 20


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_scores_are_those_of_the_reference_tools(path: Path) -> None:
    case = load(path)
    scores = asdict(score(prediction_of(case), truth_of(case)))
    assert {name: scores[name] for name in case["expected"]} == pytest.approx(
        case["expected"], abs=1e-6
    )


def test_pooled_counts_are_the_sums_and_ratios_are_of_the_sums() -> None:
    cases = [load(path) for path in CASES]
    total = score_comparison(pool([compare(prediction_of(c), truth_of(c)) for c in cases]))
    sums = {
        name: sum(case["expected"][name] for case in cases)
        for name in ("matches", "false_positives", "misses", "id_switches", "fragmentations")
    }
    assert {name: asdict(total)[name] for name in sums} == sums
    boxes = sums["matches"] + sums["misses"]
    mistakes = sums["misses"] + sums["false_positives"] + sums["id_switches"]
    assert total.mota == pytest.approx(1 - mistakes / boxes)
