"""The section `regions`: which parts of the frame are searched."""

from typing import Literal

from pydantic import Field, model_validator

from vdet.config.shapes import MOST_SHAPES, PlacedSection, PolygonSection, check_names


class RegionSettings(PolygonSection):
    """A polygon in which vehicles are shown, or not."""

    kind: Literal["include", "exclude"] = Field(
        "include",
        description="include: vehicles in it are shown; exclude: they are not, also where they are "
        "in a polygon that is included",
    )


class RegionsSettings(PlacedSection):
    """Which parts of the frame count: vehicles that stand elsewhere are not shown.

    A vehicle stands where the middle of its lower edge is. Without a polygon that is included and
    without a mask, the whole frame is, but for what is excluded.
    """

    polygons: tuple[RegionSettings, ...] = Field(
        (), max_length=MOST_SHAPES, description="parts of the frame ([] for none)"
    )
    mask: str = Field(
        "",
        max_length=4096,
        description="a picture of the frame's shape, white where vehicles are shown and black "
        'where they are not ("" for none)',
    )

    def __bool__(self) -> bool:
        return bool(self.polygons or self.mask)

    @model_validator(mode="after")
    def _lie_in_the_frame(self) -> "RegionsSettings":
        check_names(each.name for each in self.polygons)
        for each in self.polygons:
            self.check_inside(each.name, each.points)
        return self
