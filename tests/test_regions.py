"""Regions laid over frames, and what lies in them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vdet.config.places import RegionsSettings
from vdet.errors import ConfigError, ImageError
from vdet.media.images import write_image
from vdet.regions import Regions, check_mask, lay_regions

ROAD = {"name": "road", "points": [[0.5, 0.5], [1, 0.5], [1, 1], [0.25, 1]]}
BUSH = {"name": "bush", "points": [[0.8, 0.6], [0.9, 0.6], [0.9, 0.8], [0.8, 0.8]]}


def laid(
    *polygons: dict[str, Any], mask: str | None = None, size: tuple[int, int] = (320, 180)
) -> Regions:
    return Regions(RegionsSettings.model_validate({"polygons": polygons, "mask": mask}), *size)


def test_a_point_counts_where_it_is_included_and_not_excluded() -> None:
    regions = laid(ROAD, BUSH | {"kind": "exclude"})
    assert regions.contains((200, 120))
    assert not regions.contains((60, 120))
    assert not regions.contains((270, 130))


class TestMasks:
    @pytest.fixture
    def mask(self, tmp_path: Path) -> str:
        """A mask of twice the size: white at the right."""
        image = np.zeros((360, 640, 3), np.uint8)
        image[:, 400:] = 255
        write_image(tmp_path / "mask.png", image)
        return str(tmp_path / "mask.png")

    def test_white_is_included(self, mask: str) -> None:
        regions = laid(mask=mask)
        assert [regions.contains((x, 90)) for x in (199, 200, 400)] == [False, True, True]

    def test_polygons_and_a_mask_both_decide(self, mask: str) -> None:
        regions = laid(ROAD, mask=mask)
        assert [regions.contains(p) for p in ((210, 80), (190, 120), (210, 120))] == [
            False, False, True,
        ]  # fmt: skip

    def test_one_of_another_shape_is_refused(self, mask: str) -> None:
        with pytest.raises(ConfigError, match="has another shape than the frames"):
            laid(mask=mask, size=(320, 240))

    def test_one_that_is_no_picture_is_refused_before_any_work(self, tmp_path: Path) -> None:
        (tmp_path / "mask.png").write_text("white")
        for name in ("mask.png", "none.png"):
            with pytest.raises(ImageError, match=name):
                check_mask(RegionsSettings(mask=str(tmp_path / name)))


def test_pixels_for_another_shape_are_refused() -> None:
    settings = RegionsSettings.model_validate(
        {"size": [100, 100], "polygons": [{"name": "a", "points": [[0, 0], [9, 0], [9, 9]]}]}
    )
    with pytest.raises(ConfigError, match=r"^regions\.size: places are given for frames of 1"):
        lay_regions(settings, 320, 180)
