"""Every tunable, typed, with its default, its range and the words that `vdet config` prints.

The defaults are the original system's, number for number; `configs/seed.yaml` is their printed
form.
"""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator


class _FrameLength:
    """Marks a length in pixels of a frame `reference_height` rows high (see `scaling`)."""


FRAME_LENGTH = _FrameLength()
Pixels = Annotated[int, Field(ge=0, le=100_000), FRAME_LENGTH]
Fraction = Annotated[float, Field(ge=0, le=1)]

ColorSpace = Literal["YCrCb", "HSV", "LUV", "HLS", "YUV", "RGB"]


class Section(BaseModel):
    """A part of the settings: unchangeable, unknown keys refused, no NaN."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class HogSettings(Section):
    """Histogram of oriented gradients (Dalal & Triggs 2005), as cv2.HOGDescriptor computes it."""

    orientations: int = Field(8, ge=2, le=32, description="bins of gradient direction in 180°")
    cell: int = Field(8, ge=2, le=64, description="side of a cell, patch pixels")
    block: int = Field(2, ge=1, le=8, description="side of a block, cells; blocks step by one cell")
    channels: tuple[Literal[0, 1, 2], ...] = Field(
        (0, 1, 2), description="channels of the colour space that are described; [] for none"
    )

    @model_validator(mode="after")
    def _channels_are_distinct(self) -> "HogSettings":
        if len(set(self.channels)) != len(self.channels):
            raise ValueError("channels must differ from one another")
        return self


class HistogramSettings(Section):
    """Colour histogram, one a channel."""

    bins: Literal[0, 8, 16, 32, 64, 128, 256] = Field(
        32, description="equal bins over the values 0 … 255 of each channel; 0 for no histogram"
    )


class SpatialSettings(Section):
    """The patch itself, shrunk, as raw values."""

    size: int = Field(0, ge=0, le=64, description="side of the shrunk patch, pixels; 0 for none")


class FeatureSettings(Section):
    """What a patch is described by. A model carries the settings that it was trained with."""

    patch: int = Field(64, ge=16, le=256, description="side of a patch, pixels")
    color_space: ColorSpace = Field("YCrCb", description="YCrCb, HSV, LUV, HLS, YUV or RGB")
    hog: HogSettings = HogSettings()
    histogram: HistogramSettings = HistogramSettings()
    spatial: SpatialSettings = SpatialSettings()

    @model_validator(mode="after")
    def _cells_fill_the_patch(self) -> "FeatureSettings":
        if self.hog.channels:
            if self.patch % self.hog.cell:
                raise ValueError(f"patch must be a multiple of hog.cell ({self.hog.cell})")
            if self.hog.block * self.hog.cell > self.patch:
                raise ValueError("hog.block × hog.cell must not exceed patch")
        elif not (self.histogram.bins or self.spatial.size):
            raise ValueError("at least one of hog, histogram and spatial must be on")
        return self


class CalibrationSettings(Section):
    """Probability from score: a sigmoid fitted on patches the SVM has not seen (Platt 1999)."""

    folds: int = Field(3, ge=2, le=20, description="cross-validation folds")
    ensemble: bool = Field(
        True,
        description="true: keep one SVM a fold and average their probabilities; "
        "false: one SVM fitted on everything, calibrated on the folds",
    )


class FirstStageSettings(Section):
    """A cheap linear model over the first channel's HOG and the histogram, for the cascade."""

    C: float = Field(1e-3, gt=0, le=1e6, description="penalty of its linear SVM")
    recall: float = Field(
        0.999, gt=0, le=1, description="share of vehicle patches that it must let pass"
    )


class TrainingSettings(Section):
    """How `vdet train` fits the classifier."""

    C: float = Field(1.0, gt=0, le=1e6, description="penalty of the linear SVM; less is smoother")
    test_fraction: float = Field(
        0.2, gt=0, lt=1, description="share of patches held out for the test"
    )
    split: Literal["random", "tail"] = Field(
        "random",
        description="random: any patch may be held out (near-duplicates leak); "
        "tail: the last of each folder, in numeric order of file names",
    )
    max_iterations: int = Field(1000, ge=1, description="of the SVM's solver")
    seed: int = Field(0, ge=0, le=2**32 - 1, description="of the split, the folds and the solver")
    max_broken: Fraction = Field(0.01, description="share of unreadable patches that is tolerated")
    calibration: CalibrationSettings = CalibrationSettings()
    first_stage: FirstStageSettings = FirstStageSettings()


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
            raise ValueError("one of overlap and step must be given")
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
    cascade: bool = Field(
        True,
        description="dense engine: drop windows by the model's first stage (luma, histogram) "
        "before the rest of their features is computed",
    )
    probability: Fraction = Field(0.5, description="a window is a detection from here on")
    windows: tuple[WindowSettings, ...] = Field(
        (
            WindowSettings(size=128, overlap=0.8, top=380, bottom=720),
            WindowSettings(size=64, overlap=0.8, top=400, bottom=500),
        ),
        min_length=1,
        max_length=32,
        description="window sets",
    )


class HeatSettings(Section):
    """Detections of consecutive frames summed into a heatmap, and its regions."""

    frames: int = Field(2, ge=1, le=100, description="frames whose detections are summed")
    weight: Literal["none", "coverage"] = Field(
        "none",
        description="none: a window adds its probability; coverage: divided by the number of "
        "windows of its set that cover a pixel, so that the threshold does not depend on overlap",
    )
    shrink: Literal[1, 2, 4, 8] = Field(
        1, description="the map has one value for this many pixels across and down"
    )
    blur: Pixels = Field(15, description="side of the Gaussian blur, pixels; 0 or 1 for none")
    threshold: float = Field(1.4, ge=0, description="a region is where the heat is above this")


class TrackerSettings(Section):
    """How regions become cars (the original's rules; `tracking` explains each)."""

    history: int = Field(
        10, ge=1, le=1000, description="detections that a car's box is averaged over"
    )
    min_region: Pixels = Field(50, description="regions narrower or lower than this are ignored")
    near: Pixels = Field(50, description="a region within this distance of a car is close to it")
    confident_peak: float = Field(
        4.0, ge=0, description="a region with a higher peak is trusted sooner"
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


class OutputSettings(Section):
    """The video that is written."""

    codec: Literal["libx264"] = Field("libx264", description="H.264, which browsers play")
    preset: Literal["ultrafast", "superfast", "veryfast", "faster", "fast", "medium", "slow"] = (
        Field("veryfast", description="ultrafast … slow: time against size")
    )
    crf: int = Field(20, ge=0, le=51, description="quality, 0 best, 51 worst")


class Settings(Section):
    """Everything. Lengths in pixels are for a frame of `reference_height` rows."""

    reference_height: int = Field(
        720,
        ge=16,
        le=100_000,
        description="lengths in frame pixels below (search, heat, tracker) are given for a frame "
        "with this many rows; for another frame they are multiplied by "
        "rows / reference_height and rounded",
    )
    features: FeatureSettings = FeatureSettings()
    training: TrainingSettings = TrainingSettings()
    search: SearchSettings = SearchSettings()
    heat: HeatSettings = HeatSettings()
    tracker: TrackerSettings = TrackerSettings()
    output: OutputSettings = OutputSettings()
