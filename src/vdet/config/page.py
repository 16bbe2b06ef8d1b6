"""The section `page`: the page of a video."""

from pydantic import Field

from vdet.config.section import Section


class PageSettings(Section):
    """The page of a video."""

    vehicles: int = Field(
        300,
        ge=0,
        le=100_000,
        description="most vehicles that the page shows one by one: those that are shown longest",
    )
    picture: int = Field(
        200, ge=16, le=2000, description="longer side of the picture of a vehicle, pixels"
    )
    still: int = Field(960, ge=64, le=8000, description="most columns of the still under the heat")
