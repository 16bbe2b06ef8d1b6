"""The section `detector.search`: where vehicles are looked for in a frame."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from vdet.config.section import FRAME_LENGTH, Fraction, Pixels, Section

WindowShare = Annotated[float, Field(gt=0, le=1)]


class WindowSettings(Section):
    """One set of square windows over a band of rows, the whole width of the frame."""

    size: Annotated[int, Field(ge=8, le=100_000), FRAME_LENGTH] = Field(
        description="side of a window, pixels"
    )
    overlap: float | None = Field(
        None,
        ge=0,
        lt=1,
        description="share of a window that its neighbour covers too; an item has this or step",
    )
    step: int | None = Field(
        None,
        ge=1,
        description="distance to the next window, cells of the patch; the dense engine is fastest "
        "with it",
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
    """Window sets whose rows follow from their size: vehicles stand on a flat road."""

    sizes: tuple[WindowShare, ...] = Field(
        (0.05, 0.0625, 0.0875, 0.125, 0.175, 0.25, 0.3),
        max_length=32,
        description="sides of the windows, shares of the frame's width (of 16/9 of its height, "
        "where it is wider than that); [] for no sets",
    )
    zoom: float = Field(
        1.0, ge=0.1, le=10, description="multiplies the sizes; above 1 for a longer lens"
    )
    horizon: Fraction = Field(
        0.0,
        description="row of the horizon, share of the frame's height; 0: it is where the lines of "
        "the first frames meet",
    )
    highest: float = Field(
        0.6,
        ge=0,
        le=10,
        description="bottom of a set's highest windows below the horizon, in sides",
    )
    lowest: float = Field(1.1, ge=0, le=10, description="the same of its lowest windows")
    beyond: Fraction = Field(
        0.7, description="share of a window that may lie beyond the left and right of the frame"
    )
    step: int = Field(1, ge=1, le=64, description="distance to the next window, cells of the patch")

    @model_validator(mode="after")
    def _is_in_order(self) -> "PerspectiveSettings":
        if self.lowest < self.highest:
            raise ValueError("lowest must be at least highest")
        return self


class SearchSettings(Section):
    """Where vehicles are looked for in a frame."""

    engine: Literal["auto", "dense", "patch"] = Field(
        "auto",
        description="patch: every window cropped, resized, described and scored on its own; dense: "
        "each strip described once for all its windows, many times faster; auto: dense where the "
        "features allow it",
    )
    probability: Fraction = Field(0.3, description="a window is a detection from here on")
    windows: tuple[WindowSettings, ...] = Field(
        (), max_length=32, description="window sets over fixed rows; [] for none"
    )
    perspective: PerspectiveSettings = PerspectiveSettings()
    alternate: int = Field(
        2,
        ge=1,
        le=10,
        description="frames of a video over which the sets are dealt out, each searched in one",
    )

    @model_validator(mode="after")
    def _has_windows(self) -> "SearchSettings":
        if not (self.windows or self.perspective.sizes):
            raise ValueError("windows or perspective.sizes must be given")
        return self
