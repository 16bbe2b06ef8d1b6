"""The values that the settings of search and heat refuse, and the messages."""

import pytest

from vdet.config.loading import load_settings
from vdet.config.schema import PerspectiveSettings
from vdet.errors import ConfigError

WINDOWS = "detector.search.windows=[{size: 64, step: 1, top: 400, bottom: 500}]"


@pytest.mark.parametrize(
    ("assignment", "message"),
    [
        (
            "detector.search.perspective.sizes=[]",
            "detector.search: windows or perspective.sizes must be given",
        ),
        (
            "detector.search.perspective.lowest=0.5",
            "detector.search.perspective: lowest must be at least highest",
        ),
        ("detector.heat.frames=0", "detector.heat.frames: should be greater than or equal to 1"),
        ("detector.searches=0", "detector.searches: should be greater than 0"),
        ("detector.stride=0", "detector.stride: should be greater than or equal to 1"),
        (
            "detector.search.perspective.sizes=[0.1, 0]",
            "detector.search.perspective.sizes[1]: should be greater",
        ),
        (
            "detector.search.perspective.sizes=[1.5]",
            "detector.search.perspective.sizes[0]: should be less than",
        ),
        (
            "detector.search.perspective.horizon=360",
            "detector.search.perspective.horizon: should be less than",
        ),
        (
            "detector.search.perspective.beyond=-0.1",
            "detector.search.perspective.beyond: should be greater",
        ),
        (
            "detector.search.perspective.zoom=0",
            "detector.search.perspective.zoom: should be greater",
        ),
        ("detector.heat.regions=boxes", "detector.heat.regions: should be 'outline' or 'votes'"),
        ("detector.heat.votes=-1", "detector.heat.votes: should be greater than or equal to 0"),
    ],
)
def test_a_value_that_makes_no_sense_is_refused(assignment: str, message: str) -> None:
    with pytest.raises(ConfigError) as error:
        load_settings(None, [assignment], detector="svm")
    assert str(error.value).startswith(f"--set: {message}")
    assert len(str(error.value).splitlines()) == 1


def test_fixed_sets_may_stand_alone_and_beside_those_of_the_perspective() -> None:
    both = load_settings(None, [WINDOWS], detector="svm").svm.search
    assert both.windows
    assert both.perspective.sizes
    only = [WINDOWS, "detector.search.perspective.sizes=[]"]
    alone = load_settings(None, only, detector="svm").svm.search
    assert alone.windows == both.windows
    assert alone.perspective.sizes == ()


def test_the_highest_and_lowest_windows_may_be_one_row() -> None:
    assert PerspectiveSettings(highest=0.8, lowest=0.8).lowest == 0.8
