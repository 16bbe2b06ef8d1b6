"""The columns of `Detections`: what they hold and refuse, and that they cannot be changed."""

import sys
import warnings
from dataclasses import FrozenInstanceError
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from vdet.boxes import Box
from vdet.detect.detections import NO_DETECTIONS, Detections

BOXES: list[list[float]] = [[10, 20, 40, 60], [0.5, 1.5, 3.25, 4.75], [-5, -6, 7, 8]]
SCORES: list[float] = [0.9, 0.5, 0.125]
TYPED = Detections(BOXES, SCORES, classes=[1, 0, 1], names=("car", "lorry"))


def test_columns_are_arrays_of_fixed_types_and_shapes() -> None:
    detections = Detections(BOXES, SCORES, classes=[1, 0, 1], names=["car", "lorry"])
    assert len(detections) == 3
    for name, shape in (("boxes", (3, 4)), ("scores", (3,)), ("centroids", (3, 2))):
        column = getattr(detections, name)
        assert column.shape == shape
        assert column.dtype == np.float32
    assert detections.strengths.shape == (3,)
    assert detections.strengths.dtype == np.float32
    assert detections.classes is not None
    assert detections.classes.dtype == np.int32
    assert detections.names == ("car", "lorry")


def test_without_centroids_they_are_the_middles_of_the_boxes() -> None:
    assert Detections(BOXES, SCORES).centroids.tolist() == [[25, 40], [1.875, 3.125], [1, 1]]


def test_without_strengths_they_are_the_scores() -> None:
    detections = Detections(BOXES, SCORES)
    np.testing.assert_array_equal(detections.strengths, detections.scores)


def test_given_centroids_strengths_and_trace_are_kept() -> None:
    trace = object()
    centroids, strengths = [[1, 2], [3, 4], [5, 6]], [7, 8, 9]
    detections = Detections(BOXES, SCORES, centroids=centroids, strengths=strengths, trace=trace)
    assert detections.centroids.tolist() == centroids
    assert detections.strengths.tolist() == strengths
    assert detections.trace is trace
    assert detections.classes is None


@pytest.mark.parametrize("boxes", [[], np.empty((0, 4)), np.empty(0, np.float64)])
def test_a_table_may_have_no_rows(boxes: Any) -> None:
    detections = Detections(boxes, [], classes=[], names=("car",))
    assert len(detections) == 0
    assert detections.boxes.shape == (0, 4)
    assert detections.centroids.shape == (0, 2)
    assert detections.classes is not None
    assert detections.classes.shape == (0,)
    assert detections.rounded == []


def test_no_detections_has_no_rows() -> None:
    assert len(NO_DETECTIONS) == 0
    assert NO_DETECTIONS.classes is None


class TestValidation:
    @pytest.mark.parametrize(
        ("boxes", "scores", "columns", "message"),
        [
            ([[1, 2, 3]], [0.5], {}, r"boxes: of shape \(1, 3\)"),
            ([1, 2, 3, 4], [0.5], {}, r"boxes: of shape \(4,\)"),
            (BOXES, [0.5], {}, r"scores: of shape \(1,\), expected \(3,\)"),
            (BOXES, [SCORES], {}, r"scores: of shape \(1, 3\)"),
            ([], [0.5], {}, "scores: of shape"),
            (BOXES, SCORES, {"centroids": [[1, 2]]}, r"centroids: of shape \(1, 2\)"),
            (BOXES, SCORES, {"centroids": [1, 2, 3]}, r"centroids: of shape \(3,\)"),
            (BOXES, SCORES, {"strengths": [1, 2]}, r"strengths: of shape \(2,\)"),
            (BOXES, SCORES, {"classes": [0, 0], "names": ["car"]}, r"classes: of shape \(2,\)"),
        ],
    )
    def test_a_column_of_another_shape_is_refused(
        self, boxes: Any, scores: Any, columns: dict[str, Any], message: str
    ) -> None:
        with pytest.raises(ValueError, match=f"^{message}"):
            Detections(boxes, scores, **columns)

    @pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
    @pytest.mark.parametrize("column", ["boxes", "scores", "centroids", "strengths"])
    def test_a_value_that_is_not_finite_is_refused(self, column: str, value: float) -> None:
        columns: dict[str, Any] = {
            "boxes": [[0, 0, 1, 1]],
            "scores": [0.5],
            "centroids": [[0, 0]],
            "strengths": [1],
        }
        columns[column] = np.array(columns[column], np.float64)
        columns[column].flat[0] = value
        with pytest.raises(ValueError, match=f"^{column}: a value is not a finite number"):
            Detections(**columns)

    @pytest.mark.parametrize(
        "box", [[5, 5, 5, 9], [5, 5, 9, 5], [9, 5, 5, 9], [5, 9, 9, 5], [5, 5, 5, 5]]
    )
    def test_a_box_without_an_area_is_refused(self, box: list[float]) -> None:
        boxes: list[list[float]] = [[0, 0, 1, 1], box]
        with pytest.raises(ValueError, match=r"^boxes: .* no area; give x1 < x2 and y1 < y2"):
            Detections(boxes, [0.5, 0.5])

    @pytest.mark.parametrize("score", [-0.01, 1.01, 100])
    def test_a_score_outside_0_to_1_is_refused(self, score: float) -> None:
        with pytest.raises(ValueError, match=r"^scores: a score is not in 0 to 1"):
            Detections(BOXES, [0, 1, score])

    @pytest.mark.parametrize("number", [-1, 2])
    def test_a_class_without_a_name_is_refused(self, number: int) -> None:
        with pytest.raises(ValueError, match=r"^classes: an index that `names` does not have"):
            Detections(BOXES, SCORES, classes=[0, 1, number], names=("car", "lorry"))


class TestImmutability:
    @pytest.mark.parametrize("name", ["boxes", "scores", "classes", "centroids", "strengths"])
    def test_a_column_cannot_be_written_to(self, name: str) -> None:
        with pytest.raises(ValueError, match="read-only"):
            getattr(TYPED, name)[0] = 0
        with pytest.raises(ValueError, match="read-only"):
            getattr(TYPED[1:], name)[0] = 0

    @pytest.mark.parametrize("name", ["boxes", "scores", "names", "trace"])
    def test_a_column_cannot_be_replaced(self, name: str) -> None:
        with pytest.raises(FrozenInstanceError):
            setattr(TYPED, name, None)

    def test_a_later_change_of_an_argument_does_not_matter(self) -> None:
        boxes, scores = np.array(BOXES, np.float32), np.array(SCORES, np.float32)
        detections = Detections(boxes, scores, centroids=boxes[:, :2], strengths=scores)
        boxes[:], scores[:] = 0, 0
        np.testing.assert_array_equal(detections.boxes, np.array(BOXES, np.float32))
        np.testing.assert_array_equal(detections.strengths, np.array(SCORES, np.float32))
        assert detections.centroids[0].tolist() == [10, 20]


class TestRows:
    DETECTIONS = Detections(
        BOXES,
        SCORES,
        classes=[1, 0, 1],
        names=("car", "lorry"),
        centroids=[[1, 2], [3, 4], [5, 6]],
        strengths=[7, 8, 9],
        trace="trace",
    )

    @pytest.mark.parametrize(
        ("rows", "expected"),
        [
            (slice(1, None), [1, 2]),
            (slice(None, None, -1), [2, 1, 0]),
            ([2, 0], [2, 0]),
            ((2, 0), [2, 0]),
            (np.array([1, 1]), [1, 1]),
            (np.array([True, False, True]), [0, 2]),
            ([True, False, True], [0, 2]),
            (slice(0, 0), []),
        ],
    )
    def test_rows_are_chosen_in_the_order_given(self, rows: Any, expected: list[int]) -> None:
        chosen = self.DETECTIONS[rows]
        assert len(chosen) == len(expected)
        for name in ("boxes", "scores", "classes", "centroids", "strengths"):
            whole, part = getattr(self.DETECTIONS, name), getattr(chosen, name)
            np.testing.assert_array_equal(part, whole[expected])
            assert part.dtype == whole.dtype
        assert chosen.names == ("car", "lorry")
        assert chosen.trace == "trace"

    def test_an_empty_list_chooses_no_rows(self) -> None:
        assert len(self.DETECTIONS[[]]) == 0

    def test_rows_of_detections_without_classes_have_none(self) -> None:
        assert Detections(BOXES, SCORES)[1:].classes is None

    def test_a_row_beyond_the_last_is_refused(self) -> None:
        with pytest.raises(IndexError):
            self.DETECTIONS[[3]]


def test_rounded_boxes_have_whole_sides_halves_up() -> None:
    detections = Detections([[0.4, 0.5, 10.5, 9.49], [-0.5, -0.6, 1.5, 2]], [1, 1])
    assert detections.rounded == [Box(0, 1, 11, 8), Box(0, -1, 2, 3)]


def test_rounded_whole_boxes_are_the_same() -> None:
    assert Detections([[10, 20, 40, 60]], [1]).rounded == [Box(10, 20, 30, 40)]


class TestSupervision:
    @pytest.fixture
    def stub(self, monkeypatch: pytest.MonkeyPatch) -> None:
        module = ModuleType("supervision")
        vars(module)["Detections"] = SimpleNamespace
        monkeypatch.setitem(sys.modules, "supervision", module)

    @pytest.mark.usefixtures("stub")
    def test_supervision_gets_boxes_scores_and_classes(self) -> None:
        made: Any = TYPED.to_supervision()
        np.testing.assert_array_equal(made.xyxy, TYPED.boxes)
        np.testing.assert_array_equal(made.confidence, TYPED.scores)
        assert made.class_id.tolist() == [1, 0, 1]
        assert made.class_id.dtype == int
        assert made.data["class_name"].tolist() == ["lorry", "car", "lorry"]

    @pytest.mark.usefixtures("stub")
    def test_supervision_gets_no_classes_where_there_are_none(self) -> None:
        made: Any = Detections(BOXES, SCORES).to_supervision()
        assert made.class_id is None
        assert made.data == {}

    @pytest.mark.usefixtures("stub")
    def test_supervision_gets_copies(self) -> None:
        made: Any = TYPED.to_supervision()
        made.xyxy[:], made.confidence[:] = 0, 0
        np.testing.assert_array_equal(TYPED.boxes, np.array(BOXES, np.float32))

    def test_without_the_package_an_import_error_names_it(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setitem(sys.modules, "supervision", None)
        with pytest.raises(ImportError, match="supervision"):
            TYPED.to_supervision()

    @pytest.mark.parametrize("detections", [TYPED, TYPED[:0], Detections(BOXES, SCORES)])
    def test_the_real_package_takes_it(self, detections: Detections) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            supervision = pytest.importorskip("supervision")
            made = detections.to_supervision()
        assert isinstance(made, supervision.Detections)
        assert len(made) == len(detections)
        np.testing.assert_array_equal(made.xyxy, detections.boxes)
        np.testing.assert_array_equal(made.confidence, detections.scores)
