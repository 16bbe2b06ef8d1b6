"""A detector finds about the same in the planes of a decoder as in the same picture as BGR."""

import numpy as np

from codings import in_any_coding
from detect.svm.engine_comparison import fitted, log_odds, road
from vdet.boxes import Image
from vdet.config.kinds import FeatureSettings
from vdet.config.schema import SvmSettings
from vdet.detect.svm.detector import SvmDetector
from vdet.media import Picture, Planes
from vdet.media.frame import Coding

HORIZON = 0.57
"""Row of the horizon of the drawn road."""


def both_forms(image: Image, coding: Coding) -> tuple[Picture, Picture]:
    """Return an image as planes, and these as BGR."""
    picture = Picture(Planes.of_image(image, coding))
    return picture, Picture(picture.image)


@in_any_coding
def test_windows_have_about_the_same_probabilities(coding: Coding) -> None:
    search = SvmDetector(fitted(FeatureSettings()), SvmSettings(), 1280, 720, horizon=HORIZON)
    ours, expected = (
        log_odds(search.search(picture, 0)[0].probabilities)
        for picture in both_forms(road(), coding)
    )
    assert (expected > 0).any(), "nothing is found: decisions cannot differ"
    assert np.corrcoef(ours, expected)[0, 1] > 0.97
    assert np.mean((ours > 0) == (expected > 0)) > 0.95
