"""The values that the settings of search and heat refuse, and the messages."""

import pytest

from vdet.config.loading import load_settings
from vdet.config.schema import HeatSettings, PerspectiveSettings, SearchSettings, SvmSettings
from vdet.errors import ConfigError

FRAMES = HeatSettings().frames
"""Number of frames in the heat, by default."""
ALTERNATE = SearchSettings().alternate
"""Number of frames that the sets alternate over, by default."""
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
        (
            f"detector.search.alternate={FRAMES + 1}",
            "detector: heat.frames must be at least search.alternate",
        ),
        (
            f"detector.heat.frames={ALTERNATE - 1}",
            "detector: heat.frames must be at least search.alternate",
        ),
        (
            "detector.search.alternate=0",
            "detector.search.alternate: should be greater than or equal to 1",
        ),
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
        (
            "detector.heat.votes.agreement=2",
            "detector.heat.votes.agreement: should be less than or equal to 1",
        ),
        (
            "detector.heat.votes.least=-1",
            "detector.heat.votes.least: should be greater than or equal to 0",
        ),
    ],
)
def test_a_value_that_makes_no_sense_is_refused(assignment: str, message: str) -> None:
    with pytest.raises(ConfigError) as error:
        load_settings(None, [assignment])
    assert str(error.value).startswith(f"--set: {message}")
    assert len(str(error.value).splitlines()) == 1


def test_fixed_sets_may_stand_alone_and_beside_those_of_the_perspective() -> None:
    both = load_settings(None, [WINDOWS]).svm.search
    assert both.windows
    assert both.perspective.sizes
    alone = load_settings(None, [WINDOWS, "detector.search.perspective.sizes=[]"]).svm.search
    assert alone.windows == both.windows
    assert alone.perspective.sizes == ()


def test_the_heat_may_sum_as_few_frames_as_the_sets_alternate_over() -> None:
    more = max(FRAMES, ALTERNATE) + 1
    settings = SvmSettings(search=SearchSettings(alternate=more), heat=HeatSettings(frames=more))
    assert settings.heat.frames == settings.search.alternate == more


def test_the_highest_and_lowest_windows_may_be_one_row() -> None:
    assert PerspectiveSettings(highest=0.8, lowest=0.8).lowest == 0.8
