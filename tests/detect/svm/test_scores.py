"""From the strength of the evidence to a score."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdet.config.schema import ScoreSettings
from vdet.detect.svm.scores import detection_scores
from vdet.geometry import Float32Array

positive = st.floats(1e-6, 1e6)
slopes = st.floats(0.01, 100)


def scores_of(*strengths: float, middle: float = 0.3, slope: float = 2) -> Float32Array:
    return detection_scores(np.array(strengths, np.float32), middle, slope)


def test_half_of_the_boxes_with_the_middle_strength_are_vehicles() -> None:
    assert scores_of(0.3)[0] == pytest.approx(0.5)
    assert scores_of(5, middle=5, slope=7)[0] == pytest.approx(0.5)


def test_the_score_is_a_sigmoid_of_the_logarithm_of_the_strength() -> None:
    strength, middle, slope = 0.7, 0.3, 2.5
    expected = 1 / (1 + np.exp(-slope * (np.log(strength) - np.log(middle))))
    assert scores_of(strength, middle=middle, slope=slope)[0] == pytest.approx(expected, rel=1e-6)


@given(st.lists(st.floats(0, 2**100, width=32), min_size=2, max_size=20), positive, slopes)
def test_stronger_evidence_never_has_a_lower_score(
    strengths: list[float], middle: float, slope: float
) -> None:
    scores = scores_of(*sorted(strengths), middle=middle, slope=slope)
    assert (np.diff(scores) >= 0).all()
    assert (scores >= 0).all()
    assert (scores <= 1).all()


def test_no_evidence_has_the_score_0_and_endless_evidence_nears_1() -> None:
    for slope in (0.5, 2, 100):
        scores = scores_of(0, 1e-45, 1e38, slope=slope)
        assert scores.tolist() == [0, pytest.approx(0), pytest.approx(1)]


def test_no_strengths_have_no_scores() -> None:
    assert scores_of().shape == (0,)
    assert scores_of().dtype == np.float32


@given(st.floats(0, 2**127, width=32), positive, slopes)
def test_no_strength_overflows_or_warns(strength: float, middle: float, slope: float) -> None:
    (score,) = scores_of(strength, middle=middle, slope=slope)  # warnings are errors here
    assert np.isfinite(score)


def test_the_settings_allow_nothing_that_has_no_score() -> None:
    for middle, slope in ((1e-300, 100), (1e6, 100), (1e6, 1e-300)):
        settings = ScoreSettings(middle=middle, slope=slope)
        assert np.isfinite(scores_of(0, 1e-3, 1, 1e6, middle=settings.middle, slope=slope)).all()
