"""Our metrics beside those of trackeval and pycocotools, which each case names with versions.

Ignore regions were DontCare for trackeval (its KITTI reader), and crowds for pycocotools.
"""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from labels.saving import checked_video, row
from vdet.evaluate.scores import compare, pool, score, score_comparison
from vdet.labels.label import SavedTracks

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
