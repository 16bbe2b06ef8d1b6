from typing import Any

import pytest

from seed import SEED
from vdet.config.kinds import RulesTrackerSettings, SearchSettings, WindowSettings
from vdet.config.schema import Settings, SvmSettings
from vdet.config.section import scale_lengths

WINDOWS = (WindowSettings(size=64, overlap=0.5, top=400, bottom=500),)
BOTH = Settings(
    detector=SvmSettings(search=SearchSettings(windows=WINDOWS)), tracker=RulesTrackerSettings()
)
"""Settings with every frame length: window sets over fixed rows, and the rules."""
LENGTHS = {
    *(f"detector.search.windows.0.{key}" for key in ("size", "top", "bottom")),
    *(f"tracker.{key}" for key in ("min_region", "max_distance", "accepted_width", "max_combined")),
    *("tracker.merge_overlap", "tracker.match_distance"),
}


def leaves(value: Any, key: str = "") -> dict[str, Any]:
    if isinstance(value, dict):
        items = value.items()
    elif isinstance(value, (list, tuple)):
        items = {str(i): item for i, item in enumerate(value)}.items()
    else:
        return {key: value}
    return {k: v for n, item in items for k, v in leaves(item, f"{key}.{n}".lstrip(".")).items()}


def test_every_frame_length_is_scaled_and_nothing_else() -> None:
    before, after = leaves(BOTH.model_dump()), leaves(scale_lengths(BOTH, 2).model_dump())
    assert {key for key in before if before[key] != after[key]} == LENGTHS
    for key in LENGTHS:
        assert after[key] == 2 * before[key]


@pytest.mark.parametrize(
    ("rows", "large", "small"),
    [
        (360, (64, 190, 360), (32, 200, 250)),
        (1080, (192, 570, 1080), (96, 600, 750)),
        (480, (85, 253, 480), (43, 267, 333)),  # halves are rounded up
    ],
)
def test_windows_keep_their_place_in_a_frame_of_another_height(
    rows: int, large: tuple[int, ...], small: tuple[int, ...]
) -> None:
    windows = scale_lengths(SEED, rows / 720).svm.search.windows
    assert [(w.size, w.top, w.bottom) for w in windows] == [large, small]
    assert [w.overlap for w in windows] == [0.8, 0.8]
