"""Where vehicles are looked for in a frame, and how hits become cars that are followed."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from vdet.config.section import FRAME_LENGTH, Fraction, Pixels, Section


class WindowSettings(Section):
    """One set of square windows over a band of rows, the whole width of the frame."""

    size: Annotated[int, Field(ge=8, le=100_000), FRAME_LENGTH] = Field(
        description="side of a window, pixels"
    )
    overlap: float | None = Field(
        None, ge=0, lt=1, description="share of a window that its neighbour covers too; or"
    )
    step: int | None = Field(
        None,
        ge=1,
        description="distance to the next window in cells of the patch, which is what the dense "
        "engine is fastest with; one of overlap and step is given",
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


class SearchSettings(Section):
    """Where vehicles are looked for in a frame."""

    engine: Literal["auto", "dense", "patch"] = Field(
        "auto",
        description="patch: every window cropped, resized, described and scored on its own; dense: "
        "each strip described once for all its windows, many times faster; auto: dense where the "
        "features allow it",
    )
    probability: Fraction = Field(0.5, description="a window is a detection from here on")
    windows: tuple[WindowSettings, ...] = Field(
        (
            WindowSettings(size=64, step=1, top=400, bottom=488),
            WindowSettings(size=96, step=1, top=392, bottom=524),
            WindowSettings(size=128, step=1, top=388, bottom=564),
            WindowSettings(size=192, step=1, top=372, bottom=612),
        ),
        min_length=1,
        max_length=32,
        description="window sets",
    )


class HeatSettings(Section):
    """Detections of consecutive frames summed into a heatmap, and its regions."""

    frames: int = Field(4, ge=1, le=100, description="frames whose detections are summed")
    weight: Literal["none", "coverage"] = Field(
        "coverage",
        description="none: a window adds its probability; coverage: divided by the number of "
        "windows of its set that cover a pixel, so that the threshold does not depend on overlap",
    )
    shrink: Literal[1, 2, 4, 8] = Field(
        4, description="the map has one value for this many pixels across and down"
    )
    blur: Pixels = Field(15, description="side of the Gaussian blur, pixels; 0 or 1 for none")
    threshold: float = Field(0.5, ge=0, description="a region is where the heat is above this")


class TrackerSettings(Section):
    """How regions become cars (the original's rules; `tracking` explains each)."""

    history: int = Field(
        10, ge=1, le=1000, description="detections that a car's box is averaged over"
    )
    min_region: Pixels = Field(50, description="regions narrower or lower than this are ignored")
    near: Pixels = Field(50, description="a region within this distance of a car is close to it")
    confident_peak: float = Field(
        2.0, ge=0, description="a region with a higher peak is trusted sooner"
    )
    detections_needed: int = Field(10, ge=1, description="in a row, before a car is shown")
    confident_detections_needed: int = Field(
        3, ge=1, description="the same, after a confident peak"
    )
    wide: Pixels = Field(
        200, description="a region wider than this is always good enough for its car"
    )
    good_fraction: Fraction = Field(2 / 3, description="so is one wider than this share of its car")
    max_combined: Pixels = Field(
        250, description="two regions of one car, combined, must be narrower"
    )
    combined_tolerance: Fraction = Field(
        1 / 3, description="and differ in width from the car by no more than this share of it"
    )
    merge_overlap: Pixels = Field(
        40, description="cars in one region that overlap by more, across and down, become one"
    )
    match_distance: Pixels = Field(50, description="a car is looked for this far from where it was")
    match_method: Literal["ccoeff_normed", "ccorr_normed", "sqdiff_normed"] = Field(
        "ccoeff_normed", description="score of the template match, as cv2.matchTemplate names it"
    )
    match_score: Fraction = Field(
        0.5, description="a match must score this; 1 is perfect (sqdiff_normed is turned round)"
    )
    young: int = Field(
        7, ge=0, description="a car with fewer detections is deleted at its first miss"
    )
    max_matches: int = Field(
        12, ge=1, description="so is one whose last detections all were matches"
    )
    max_misses: int = Field(5, ge=1, description="so is one missed in this many frames in a row")
