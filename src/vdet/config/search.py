"""The section `detector.search`: which windows of a frame are searched, and how."""

from typing import Annotated

from pydantic import Field, model_validator

from vdet.config.section import FRAME_LENGTH, Pixels, Section, Share

WindowShare = Annotated[float, Field(gt=0, le=1)]


class WindowSettings(Section):
    """A set of square windows over a band of rows and the whole width of the frame."""

    size: Annotated[int, Field(ge=8, le=100_000), FRAME_LENGTH] = Field(
        description="side of a window, pixels"
    )
    overlap: float | None = Field(
        None,
        ge=0,
        lt=1,
        description="share of a window that the next one covers too; give either overlap or step",
    )
    step: int | None = Field(
        None,
        ge=1,
        description="distance to the next window, cells of the patch; the search is faster with "
        "step than with overlap",
    )
    top: Pixels = Field(description="first row of the band")
    bottom: Pixels = Field(description="first row below the band")

    @model_validator(mode="after")
    def _fits_its_band(self) -> "WindowSettings":
        if self.bottom - self.top < self.size:
            raise ValueError("bottom must be at least top + size")
        if (self.overlap is None) == (self.step is None):
            raise ValueError("one of overlap and step must be given, the other left out or null")
        if self.overlap is not None and int(self.size * (1 - self.overlap)) < 1:
            raise ValueError("overlap leaves a step of less than a pixel")
        return self


class PerspectiveSettings(Section):
    """Window sets whose rows follow from their size, because vehicles stand on a flat road."""

    sizes: tuple[WindowShare, ...] = Field(
        (0.05, 0.0625, 0.0875, 0.125, 0.175, 0.25, 0.3),
        max_length=32,
        description="one set for each size: side of its windows, share of the frame's width (of a "
        "frame wider than 16:9, share of 16/9 of its height); [] for no sets",
    )
    zoom: float = Field(
        1.0, ge=0.1, le=10, description="factor of all sizes; above 1 for a longer lens"
    )
    horizon: Share = Field(
        0.0,
        description="row of the horizon, share of the frame's height; 0: found in the first "
        "frames, where the lines of the road meet",
    )
    highest: float = Field(
        0.6,
        ge=0,
        le=10,
        description="distance from the horizon down to the bottom of a set's highest windows, "
        "sides of a window",
    )
    lowest: float = Field(
        1.1,
        ge=0,
        le=10,
        description="distance from the horizon down to the bottom of a set's lowest windows, "
        "sides of a window",
    )
    beyond: Share = Field(
        0.7, description="share of a window that may lie beyond the left or right of the frame"
    )
    step: int = Field(1, ge=1, le=64, description="distance to the next window, cells of the patch")

    @model_validator(mode="after")
    def _is_in_order(self) -> "PerspectiveSettings":
        if self.lowest < self.highest:
            raise ValueError("lowest must be at least highest")
        return self


class SearchSettings(Section):
    """Which windows of a frame are searched, and how."""

    probability: Share = Field(
        0.3, description="least probability of a hit, a window that counts as evidence"
    )
    windows: tuple[WindowSettings, ...] = Field(
        (), max_length=32, description="window sets over fixed rows ([] for none)"
    )
    perspective: PerspectiveSettings = PerspectiveSettings()

    @model_validator(mode="after")
    def _has_windows(self) -> "SearchSettings":
        if not (self.windows or self.perspective.sizes):
            raise ValueError("windows or perspective.sizes must be given")
        return self
