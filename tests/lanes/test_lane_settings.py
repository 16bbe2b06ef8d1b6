"""Settings of the lane finder: their limits."""

import pytest
from pydantic import ValidationError

from vdet.config.lanes import LaneSettings


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"top": 0.95}, "bottom must be below top"),
        ({"top_left": 0.6}, "closer together at top"),
        ({"bottom_left": 0.46, "bottom_right": 0.54}, "closer together at top"),
        ({"length": float("nan")}, "finite"),
        ({"length": 500}, "less than or equal to 200"),
    ],
)
def test_a_top_view_that_is_not_a_trapezoid_is_refused(
    changes: dict[str, float], message: str
) -> None:
    with pytest.raises(ValidationError, match=message):
        LaneSettings(**(LaneSettings().model_dump() | changes))
