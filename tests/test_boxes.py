"""One box, columns of boxes, and how much boxes overlap."""

import sys
import warnings
from dataclasses import FrozenInstanceError
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdet.boxes import Box, Boxes, Detection, are_nested, clipped, coverage, iou_matrix

places = st.integers(-50, 50)
boxes = st.builds(Box.sized, places, places, st.integers(0, 60), st.integers(0, 60))
solid = st.builds(Box.sized, places, places, st.integers(1, 60), st.integers(1, 60))


def pixels(box: Box) -> set[tuple[int, int]]:
    x1, y1, x2, y2 = box.pixels
    return {(x, y) for x in range(x1, x2) for y in range(y1, y2)}


def columns(*each: Box) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return np.array([(box.x1, box.y1, box.x2, box.y2) for box in each], np.float64).reshape(-1, 4)


class TestBox:
    @pytest.mark.parametrize(
        ("point", "inside"),
        [((10, 20), True), ((39.9, 59.9), True), ((40, 30), False), ((20, 60), False)],
    )
    def test_near_sides_belong_to_the_box_and_far_sides_do_not(
        self, point: tuple[float, float], inside: bool
    ) -> None:
        assert Box(10, 20, 40, 60).contains(point) is inside

    def test_sides_are_rounded_to_whole_pixels_halves_up(self) -> None:
        assert Box(0.4, 0.5, 10.5, 9.49).pixels == (0, 1, 11, 9)
        assert Box(-0.5, -0.6, 1.5, 2).xywh == (0, -1, 2, 3)
        assert Box(0.6, 0.6, 1.2, 1.2).xywh == (1, 1, 1, 1), "a format needs an area"

    def test_what_is_cut_is_a_view_of_the_part_in_the_image(self) -> None:
        image = np.zeros((10, 20, 3), np.uint8)
        Box(-5, 7.6, 2.4, 99).cut(image)[:] = 1
        assert np.argwhere(image[..., 0]).tolist() == [[8, 0], [8, 1], [9, 0], [9, 1]]

    @given(boxes, boxes)
    def test_intersection_union_and_iou_are_those_of_the_pixels(self, one: Box, other: Box) -> None:
        common, total = pixels(one) & pixels(other), pixels(one) | pixels(other)
        assert pixels(one.intersection(other)) == common
        assert pixels(one.union(other)) >= total
        assert one.iou(other) == pytest.approx(len(common) / len(total) if total else 0)


@given(solid, solid)
def test_the_overlaps_of_columns_are_those_of_single_boxes(one: Box, other: Box) -> None:
    assert iou_matrix(columns(one), columns(other)).item() == pytest.approx(one.iou(other))
    covered = coverage(columns(one), columns(other)).item()
    assert covered == pytest.approx(one.intersection(other).area / one.area)
    part = one.clipped(20, 30)
    if part.area:
        assert clipped(columns(one), (20, 30)).tolist() == columns(part).tolist()


@pytest.mark.parametrize(
    ("scores", "nested"),
    [((0.9, 0.8), [False, True]), ((0.5, 0.5), [False, True]), ((0.8, 0.9), [True, False])],
)
def test_of_two_boxes_in_one_another_the_one_with_the_lower_score_is_nested(
    scores: tuple[float, float], nested: list[bool]
) -> None:
    whole, inside, beside = Box(0, 0, 80, 60), Box(10, 10, 50, 40), Box(50, 0, 130, 60)
    assert are_nested(columns(whole, inside), scores).tolist() == nested
    assert are_nested(columns(inside, whole), scores[::-1]).tolist() == nested[::-1]
    assert not are_nested(columns(whole, beside), scores).any()


SIDES: list[list[float]] = [[10, 20, 40, 60], [0.5, 1.5, 3.25, 4.75], [-5, -6, 7, 8]]
SCORES: list[float] = [0.9, 0.5, 0.125]
FOUND = Boxes(
    SIDES, SCORES, classes=[1, 0, 1], names=("car", "lorry"), ids=[4, 5, 6],
    data={"strength": [7, 8, 9], "centroid": [[1, 2], [3, 4], [5, 6]]}, trace="trace",
)  # fmt: skip
COLUMNS = ("sides", "scores", "classes", "ids")


class TestBoxes:
    def test_columns_are_arrays_of_fixed_types(self) -> None:
        kinds = {name: getattr(FOUND, name).dtype for name in COLUMNS}
        assert kinds == {"sides": float, "scores": float, "classes": "int32", "ids": "int64"}
        assert FOUND.data["centroid"].shape == (3, 2)
        assert FOUND.class_names == ["lorry", "car", "lorry"]

    def test_a_row_is_a_detection(self) -> None:
        rows = list(FOUND)
        assert rows[0] == FOUND[0] == Detection(Box(10, 20, 40, 60), 0.9, "lorry", 4)
        assert FOUND[-1] == rows[-1]
        assert Boxes(SIDES, SCORES)[1] == Detection(Box(0.5, 1.5, 3.25, 4.75), 0.5)

    @pytest.mark.parametrize("empty", [[], np.empty((0, 4)), np.empty(0)])
    def test_a_table_may_have_no_rows(self, empty: Any) -> None:
        found = Boxes(empty, [], classes=[], names=("car",), data={"strength": []})
        assert (len(found), list(found), found.sides.shape) == (0, [], (0, 4))

    @pytest.mark.parametrize(
        ("rows", "expected"),
        [
            (slice(1, None), [1, 2]),
            (slice(None, None, -1), [2, 1, 0]),
            ([2, 0], [2, 0]),
            (np.array([True, False, True]), [0, 2]),
            ([], []),
        ],
    )
    def test_rows_are_chosen_in_the_order_given(self, rows: Any, expected: list[int]) -> None:
        chosen = FOUND[rows]
        for name in COLUMNS:
            assert getattr(chosen, name).tolist() == getattr(FOUND, name)[expected].tolist()
        for name, column in FOUND.data.items():
            assert chosen.data[name].tolist() == column[expected].tolist()
        assert (chosen.names, chosen.trace) == (("car", "lorry"), "trace")

    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"sides": [[1, 2, 3]] * 3}, r"sides: has shape \(3, 3\)"),
            ({"scores": [0.5]}, r"scores: has shape \(1,\), expected \(3,\)"),
            ({"classes": [0, 0]}, r"classes: has shape \(2,\)"),
            ({"ids": [1]}, r"ids: has shape \(1,\)"),
            ({"data": {"strength": [1]}}, r"strength: has shape \(1,\)"),
            ({"scores": [0, 1, np.nan]}, "scores: a value is not a finite number"),
            ({"sides": [*SIDES[:2], [5, 5, 5, 9]]}, "sides: .* no area; must be x1 < x2 and y1"),
            ({"scores": [0, 1, 1.01]}, "scores: must be from 0 to 1"),
            ({"classes": [0, 1, 2]}, "classes: an index is not in `names`"),
            ({"data": {"class_scores": [[1]] * 3}}, "class_scores: must have a column for each"),
        ],
    )
    def test_what_cannot_be_is_refused(self, changes: dict[str, Any], message: str) -> None:
        given: dict[str, Any] = {"sides": SIDES, "scores": SCORES, "names": ("car", "lorry")}
        with pytest.raises(ValueError, match=f"^{message}"):
            Boxes(**given | changes)

    def test_nothing_can_be_changed(self) -> None:
        sides = np.array(SIDES)
        found = Boxes(sides, SCORES)
        sides[:] = 0
        assert found.sides.tolist() == SIDES
        for name in COLUMNS:
            with pytest.raises(ValueError, match="read-only"):
                getattr(FOUND[1:], name)[0] = 0
        with pytest.raises(FrozenInstanceError):
            found.scores = found.scores  # type: ignore[misc]


class TestSupervision:
    @pytest.fixture
    def stub(self, monkeypatch: pytest.MonkeyPatch) -> None:
        module = ModuleType("supervision")
        vars(module)["Detections"] = SimpleNamespace
        monkeypatch.setitem(sys.modules, "supervision", module)

    @pytest.mark.usefixtures("stub")
    def test_supervision_gets_copies_of_the_columns(self) -> None:
        made: Any = FOUND.to_supervision()
        assert made.xyxy.tolist() == SIDES
        assert made.confidence.tolist() == SCORES
        assert (made.class_id.tolist(), made.tracker_id.tolist()) == ([1, 0, 1], [4, 5, 6])
        assert made.data["class_name"].tolist() == ["lorry", "car", "lorry"]
        made.xyxy[:] = 0
        assert FOUND.sides.tolist() == SIDES
        plain: Any = Boxes(SIDES, SCORES).to_supervision()
        assert (plain.class_id, plain.tracker_id, plain.data) == (None, None, {})

    @pytest.mark.parametrize("found", [FOUND, FOUND[:0], Boxes(SIDES, SCORES)])
    def test_the_real_package_takes_it(self, found: Boxes) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            supervision = pytest.importorskip("supervision")
            made = found.to_supervision()
        assert isinstance(made, supervision.Detections)
        assert made.xyxy.tolist() == found.sides.tolist()


def test_pandas_gets_a_column_for_each_field(monkeypatch: pytest.MonkeyPatch) -> None:
    module = ModuleType("pandas")
    vars(module)["DataFrame"] = dict
    monkeypatch.setitem(sys.modules, "pandas", module)
    table = FOUND.to_pandas()
    assert list(table)[:7] == ["x1", "y1", "x2", "y2", "score", "class_name", "id"]
    assert np.column_stack([table[name] for name in ("x1", "y1", "x2", "y2")]).tolist() == SIDES
    assert table["class_name"] == ["lorry", "car", "lorry"]
    assert {name.rstrip("_01") for name in list(table)[7:]} == set(FOUND.data)
