import numpy as np
import pytest

from vdet.config.schema import ScoreSettings, StillSettings, SvmSettings
from vdet.detect.svm.scores import detection_scores


def test_the_middle_has_score_one_half_and_no_strength_has_0() -> None:
    assert detection_scores([0.0, 0.3], ScoreSettings(middle=0.3, slope=2.0)) == pytest.approx(
        [0, 0.5]
    )


def test_it_is_a_logistic_function_of_the_logarithm() -> None:
    strengths = np.array([0.1, 0.6, 1.2])
    logits = 2.5 * (np.log(strengths) - np.log(0.3))
    expected = 1 / (1 + np.exp(-logits))
    assert detection_scores(strengths, ScoreSettings(middle=0.3, slope=2.5)) == pytest.approx(
        expected, rel=1e-5
    )


def test_more_strength_never_has_a_lower_score_nor_one_above_1() -> None:
    scores = detection_scores(np.geomspace(1e-6, 1e6, 200), ScoreSettings(middle=7.05, slope=1.14))
    assert scores.dtype == np.float32
    assert (np.diff(scores) >= 0).all()
    assert scores.max() <= 1


def test_no_detections_have_no_scores() -> None:
    assert detection_scores([], ScoreSettings(middle=0.3, slope=2.0)).shape == (0,)


@pytest.mark.parametrize("strength", [0, 1e-300, 0.05, 0.272, 0.42, 3.0, 1e300])
def test_the_least_score_of_a_still_picture_is_that_of_its_least_strength(strength: float) -> None:
    settings = SvmSettings(stills=StillSettings(strength=strength))
    expected = detection_scores([strength], settings.score)[0]
    assert settings.shown_score == pytest.approx(expected, abs=1e-6)
    assert settings.showing_all().shown_score == 0
    assert settings.showing_all().search_key == settings.search_key
