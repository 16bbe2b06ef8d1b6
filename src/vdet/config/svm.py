"""The section `detector` of the linear SVM: its features, windows, heatmap and scores."""

import math
from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from vdet.config.detector import DetectorSettings, Foot, Searches
from vdet.config.section import FRAME_LENGTH, Pixels, Section, Share


class HogSettings(Section):
    """Histograms of oriented gradients (Dalal & Triggs 2005), as cv2.HOGDescriptor gives them."""

    orientations: int = Field(8, ge=2, le=32)
    """Number of bins for gradient directions of 0 to 180°."""
    cell: int = Field(4, ge=2, le=64)
    """Side of a cell, in pixels of the patch."""
    block: int = Field(2, ge=1, le=8)
    """Side of a block, in cells."""


class HistogramSettings(Section):
    """Colour histogram of each channel."""

    bins: Literal[8, 16, 32, 64, 128, 256] = 32
    """Number of equal bins for values of 0 to 255."""


class FeatureSettings(Section):
    """Features of a patch; they must be those that the model was trained with."""

    patch: int = Field(32, ge=16, le=256)
    """Side of a patch, in pixels."""
    halved: Annotated[tuple[Literal[0, 1, 2], ...], Field(max_length=3)] = (1, 2)
    """Channels of YCrCb that are described at half their size, with HOG cells of half the side.
    Video has chroma at half size.
    """
    hog: HogSettings = HogSettings()
    histogram: HistogramSettings = HistogramSettings()

    @model_validator(mode="after")
    def _cells_fill_the_patch(self) -> "FeatureSettings":
        if self.patch % self.hog.cell:
            raise ValueError(f"patch must be a multiple of hog.cell ({self.hog.cell})")
        if self.hog.block * self.hog.cell > self.patch:
            raise ValueError("hog.block × hog.cell must not exceed patch")
        if self.halved and (self.hog.cell % 2 or self.hog.cell < 4):
            raise ValueError("hog.cell must be even, and 4 or more, or halved must be []")
        return self

    @property
    def blocks(self) -> int:
        """Number of blocks across a patch; blocks are a cell apart."""
        return self.patch // self.hog.cell - self.hog.block + 1

    @property
    def hog_length(self) -> int:
        """Number of HOG features, which come first; 4,704 for the seed's settings."""
        return 3 * self.blocks**2 * self.hog.block**2 * self.hog.orientations

    @property
    def length(self) -> int:
        """Number of all features; 4,800 for the seed's settings."""
        return self.hog_length + 3 * self.histogram.bins

    def shrink(self, channel: int) -> int:
        """Return how many times smaller than the patch a channel is described: 1 or 2."""
        return 2 if channel in self.halved else 1


class WindowSettings(Section):
    """A set of square windows over a band of rows and the whole width of the frame."""

    size: Annotated[int, Field(ge=8, le=100_000), FRAME_LENGTH]
    """Side of a window, in pixels."""
    overlap: float = Field(ge=0, lt=1)
    """Fraction of a window that the next one covers too."""
    top: Pixels
    """First row of the band."""
    bottom: Pixels
    """First row below the band."""

    @model_validator(mode="after")
    def _fits_its_band(self) -> "WindowSettings":
        if self.bottom - self.top < self.size:
            raise ValueError("bottom must be at least top + size")
        return self


class PerspectiveSettings(Section):
    """Window sets whose rows follow from their size, because vehicles stand on a flat road."""

    sizes: tuple[Annotated[float, Field(gt=0, le=1)], ...] = Field(
        (0.05, 0.0625, 0.0875, 0.125, 0.175, 0.25, 0.3), max_length=32
    )
    """Side of the windows of each set, as a fraction of the frame's width. In frames wider than
    16:9, as a fraction of 16/9 of the height.
    """
    horizon: float | None = Field(None, ge=-1, le=1)
    """Row of the horizon, as a fraction of the frame's height. null: where the lines of the road
    meet in the first frames.
    """


class SearchSettings(Section):
    """Which windows of a frame are searched."""

    probability: Share = 0.3
    """Minimum probability of a hit: a window that counts as evidence."""
    windows: tuple[WindowSettings, ...] = Field((), max_length=32)
    """Window sets over fixed rows."""
    perspective: PerspectiveSettings = PerspectiveSettings()


class HeatSettings(Section):
    """How the hits of consecutive frames are summed into a heatmap, and become detections."""

    frames: int = Field(2, ge=1, le=100)
    """Number of searched frames whose hits are summed."""
    blur: Annotated[int, Field(ge=1, le=100_000), FRAME_LENGTH] = 15
    """Side of the Gaussian kernel that blurs the heat, in pixels."""
    threshold: float = Field(0.075, ge=0)
    """Heat above which a pixel is hot."""
    regions: Literal["outline", "votes"] = "votes"
    """outline: a hit adds its probability to the heat; each connected hot area is a detection, with
    its bounding box. votes: a hit adds less the more windows of its set cover a pixel; the boxes of
    the hits in a hot area decide how many vehicles it shows, and where.
    """
    votes: float = Field(0.12, ge=0)
    """Minimum weight of hits that agree on a vehicle, with votes."""


class ScoreSettings(Section):
    """Score of a box: 1 / (1 + (middle / evidence) ** slope).

    It is the fraction of such boxes that show a vehicle. Fitted on frames that the model has not
    seen.
    """

    middle: float = Field(0.5, gt=0, le=1e6)
    """Evidence, heat or weight of hits, at which it is 0.5."""
    slope: float = Field(3.25, gt=0, le=100)
    """Steepness of the score as the evidence grows."""

    def of(self, evidence: float) -> float:
        """Return the score, 0 to 1, of a box with this evidence."""
        if not evidence:
            return 0.0
        relative = math.log(evidence) - math.log(self.middle)
        return (1 + math.tanh(self.slope * relative / 2)) / 2


class StillSettings(Section):
    """Which detections are shown in a still picture; in video, the tracker decides."""

    strength: float = Field(0.84, ge=0)
    """Minimum evidence: heat, or with votes the weight of the hits."""
    width: Share = 0.028
    """Minimum width of a box, as a fraction of the picture's width."""
    height: Share = 0.0
    """Minimum height of a box, as a fraction of the picture's height."""


class SvmSettings(DetectorSettings):
    """The detector: a linear SVM on HOG and colour features, sliding windows and a heatmap."""

    model_suffix: ClassVar[str | None] = ".npz"

    kind: Literal["svm"] = "svm"
    """svm: a linear SVM on HOG and colour features."""
    searches_per_second: Searches = 8.0
    foot: Foot = 0.04
    features: FeatureSettings = FeatureSettings()
    search: SearchSettings = SearchSettings()
    heat: HeatSettings = HeatSettings()
    score: ScoreSettings = ScoreSettings()
    stills: StillSettings = StillSettings()

    @property
    def search_key(self) -> object:
        """What the search of a frame depends on: all but heat, score and still pictures."""
        return self.kind, self.features, self.search

    @property
    def shown_score(self) -> float:
        """Minimum score of a detection that is shown in a still picture."""
        return self.score.of(self.stills.strength)

    def showing_all(self) -> "SvmSettings":
        """Return settings without `stills.strength`; the minimum size stays."""
        return self.model_copy(update={"stills": self.stills.model_copy(update={"strength": 0.0})})
