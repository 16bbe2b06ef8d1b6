"""Regions laid over frames, and what lies in them."""

from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import pytest

from vdet import load_settings
from vdet.config.scene import RegionSettings
from vdet.config.schema import Settings
from vdet.errors import ConfigError, ImageError
from vdet.regions import Regions, check_masks
from writing import write_image

ROAD = {"name": "road", "points": [[0.5, 0.5], [1, 0.5], [1, 1], [0.25, 1]]}
BUSH = {"name": "bush", "points": [[0.8, 0.6], [0.9, 0.6], [0.9, 0.8], [0.8, 0.8]]}


def laid(*regions: dict[str, Any], size: tuple[int, int] = (320, 180)) -> Regions:
    return Regions(Settings.model_validate({"regions": regions}).regions, *size)


def test_a_point_counts_where_it_is_included_and_not_excluded() -> None:
    regions = laid(ROAD, BUSH | {"kind": "exclude"})
    assert regions.contains((200, 120))
    assert not regions.contains((60, 120))
    assert not regions.contains((270, 130))


@pytest.mark.parametrize("row", [0.63, 0.75, 0.93])
def test_ahead_is_the_lane_of_a_dashcam_without_the_kerb(row: float) -> None:
    regions = Regions(load_settings("ahead").regions, 1000, 1000)
    half = 40 + 250 * (row - 0.63) / 0.3  # of the lane in `LaneSettings`
    for offset, is_ahead in ((0, True), (0.9, True), (-0.9, True), (1.4, False), (-1.4, False)):
        assert regions.contains((500 + offset * half, 1000 * row)) == is_ahead


class TestMasks:
    @pytest.fixture
    def mask(self, tmp_path: Path) -> dict[str, Any]:
        """A mask of twice the size: white at the right."""
        image = np.zeros((360, 640, 3), np.uint8)
        image[:, 400:] = 255
        write_image(tmp_path / "mask.png", image)
        return {"name": "mask", "mask": str(tmp_path / "mask.png")}

    def test_white_is_included_or_excluded(self, mask: dict[str, Any]) -> None:
        included, excluded = laid(mask), laid(mask | {"kind": "exclude"})
        assert [included.contains((x, 90)) for x in (199, 200, 400)] == [False, True, True]
        assert [excluded.contains((x, 90)) for x in (199, 200, 400)] == [True, False, False]

    def test_a_vehicle_is_in_any_of_the_included_regions(self, mask: dict[str, Any]) -> None:
        regions = laid(ROAD, mask)
        contained = [regions.contains(point) for point in ((210, 80), (190, 120), (60, 80))]
        assert contained == [True, True, False]

    def test_one_of_another_shape_is_refused(self, mask: dict[str, Any]) -> None:
        with pytest.raises(ConfigError, match="its aspect ratio differs from frames"):
            laid(mask, size=(320, 240))

    def test_one_that_is_no_picture_is_refused_before_any_work(self, tmp_path: Path) -> None:
        (tmp_path / "mask.png").write_text("white")
        for name in ("mask.png", "none.png"):
            region = RegionSettings(name="a", mask=str(tmp_path / name))
            with pytest.raises(ImageError, match=name):
                check_masks([region])

    @pytest.mark.parametrize("mode", ["RGBA", "LA", "P"])
    def test_what_is_transparent_is_not_in_it(
        self, tmp_path: Path, mode: str, caplog: pytest.LogCaptureFixture
    ) -> None:
        alpha = np.zeros((9, 16), np.uint8)
        image = PIL.Image.new("RGB", (16, 9), "white").convert(mode)
        if mode == "P":  # index 0 is white, and transparent
            image = PIL.Image.fromarray(alpha)
            image.putpalette([255] * 6)
            image.paste(1, (8, 0, 16, 9))
            image.save(tmp_path / "mask.png", transparency=0)
        else:
            alpha[:, 8:] = 255
            image.putalpha(PIL.Image.fromarray(alpha))
            image.save(tmp_path / "mask.png")
        mask = {"name": "mask", "mask": str(tmp_path / "mask.png")}
        expected = np.arange(16) >= 8
        assert (laid(mask, size=(16, 9)).pixels == expected).all()
        check_masks(Settings.model_validate({"regions": [mask]}).regions)
        assert caplog.messages == []

    def test_one_that_covers_the_whole_frame_gives_a_warning(
        self, tmp_path: Path, caplog: pytest.LogCaptureFixture
    ) -> None:
        write_image(tmp_path / "mask.png", np.full((9, 16, 3), 255, np.uint8))
        check_masks([RegionSettings(name="a", mask=str(tmp_path / "mask.png"))])
        text = "covers the whole frame; draw what is outside in black"
        assert caplog.messages == [f"{tmp_path}/mask.png: {text}"]

    @pytest.mark.parametrize("white", [0, 1])
    def test_one_without_white_is_refused_before_any_work(self, tmp_path: Path, white: int) -> None:
        write_image(tmp_path / "mask.png", np.full((9, 16, 3), white, np.uint8))
        region = RegionSettings(name="a", mask=str(tmp_path / "mask.png"))
        with pytest.raises(ConfigError, match=rf"mask\.png: .*brightest pixel is {white} of 255"):
            check_masks([region])

    @pytest.mark.parametrize("size", [(1, 1), (16, 9)])
    def test_a_small_one_is_enlarged(self, tmp_path: Path, size: tuple[int, int]) -> None:
        write_image(tmp_path / "mask.png", np.full((*size[::-1], 3), 255, np.uint8))
        mask = {"name": "mask", "mask": str(tmp_path / "mask.png")}
        assert laid(mask, size=(size[0] * 20, size[1] * 20)).pixels.all()


def test_regions_that_leave_nothing_of_the_frame_are_refused() -> None:
    everything = {"name": "all", "points": [[0, 0], [1, 0], [1, 1], [0, 1]], "kind": "exclude"}
    with pytest.raises(ConfigError, match=r"regions \(road, all\): nothing of the frame is left"):
        laid(ROAD, everything)
