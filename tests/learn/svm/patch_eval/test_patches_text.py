import json

import numpy as np

from vdet.learn.svm.patch_eval.evaluate import GroupScores, PatchReport, TrialReport
from vdet.learn.svm.patch_eval.metrics import patch_scores
from vdet.learn.svm.patch_eval.text import lines, plain


def trial(name: str, groups: tuple[str, ...]) -> TrialReport:
    vehicles = patch_scores(np.array([True, True]), np.array([0.9, 0.2]))
    return TrialReport(
        name=name,
        meaning=f"the {name} test",
        scores=patch_scores(np.array([True, True, False]), np.array([0.9, 0.2, 0.1])),
        groups=tuple(GroupScores(group, vehicles) for group in groups),
        reliability=(),
        curves=None,
        mistakes=(),
    )


REPORT = PatchReport(2, 1, 0, (trial("tail", ("vehicles/a",)), trial("groups", ("vehicles/b",))))


def test_the_tests_are_side_by_side() -> None:
    text = "\n".join(lines(REPORT))
    (accuracy,) = (line for line in text.splitlines() if line.startswith("accuracy  "))
    assert accuracy.count("0.6667 [") == 2
    assert "the groups test" in text


def test_a_group_that_a_test_lacks_has_a_dash() -> None:
    rows = [line.split() for line in lines(REPORT) if line.startswith("vehicles/")]
    assert [row[0] for row in rows] == ["vehicles/a", "vehicles/b"]
    assert rows[0][-1] == "–"
    assert rows[1][1] == "–"


def test_plain_values_are_json_with_plain_keys() -> None:
    values = json.loads(json.dumps(plain(REPORT), allow_nan=False))
    first = values["trials"][0]
    assert first["name"] == "tail"
    assert first["scores"]["precision"] == 1
    assert first["scores"]["recall"] == 0.5
    assert first["groups"][0]["scores"]["roc_auc"] is None
    assert set(first["scores"]["intervals"]["accuracy"]) == {"low", "high"}
