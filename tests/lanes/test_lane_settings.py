"""Settings of the lane finder: limits, descriptions, effects."""

import pytest
from pydantic import ValidationError

from vdet.config.lanes import LaneSettings, TopViewSettings
from vdet.config.section import scale_lengths


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"top": 0.95}, "bottom must be below top"),
        ({"top_left": 0.6}, "closer together at top"),
        ({"bottom_left": 0.46, "bottom_right": 0.54}, "closer together at top"),
        ({"length": float("nan")}, "finite"),
        ({"length": 500, "along": 50, "across": 200}, "not give more than 4000000 pixels"),
    ],
)
def test_a_top_view_that_is_not_a_trapezoid_is_refused(
    changes: dict[str, float], message: str
) -> None:
    with pytest.raises(ValidationError, match=message):
        TopViewSettings(**(TopViewSettings().model_dump() | changes))


def test_every_setting_has_a_description() -> None:
    for section in (LaneSettings(), *LaneSettings().__dict__.values()):
        assert type(section).__doc__
        for name, field in type(section).model_fields.items():
            assert field.description or name in LaneSettings.model_fields


def test_no_setting_depends_on_the_frame_size() -> None:
    assert scale_lengths(LaneSettings(), 2.0) == LaneSettings()
