"""A world as plain as can be: cars are red rectangles on grey, and the model is sure of red."""

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Self

import numpy as np

from boxing import moved_to
from vdet.boxes import NO_BOXES, Box, Boxes, Image
from vdet.config.kinds import (
    FeatureSettings,
    HeatSettings,
    HistogramSettings,
    PerspectiveSettings,
    RulesTrackerSettings,
    ScoreSettings,
    SearchSettings,
    WindowSettings,
)
from vdet.config.schema import Settings, SvmSettings
from vdet.config.section import REFERENCE_HEIGHT, scale_lengths
from vdet.detect.svm.detector import SvmModel
from vdet.detect.svm.model import LinearModel, save_model
from vdet.media import Frame, Picture

WIDTH, HEIGHT = 320, 240
SCALE = REFERENCE_HEIGHT / HEIGHT
CAR = Box.sized(96, 120, 64, 48)
BINS = 8
COLOUR = FeatureSettings(halved=(), histogram=HistogramSettings(bins=BINS))
SETTINGS = Settings(
    detector=SvmSettings(
        stride=1,
        features=COLOUR,
        search=SearchSettings(
            probability=0.5,
            windows=(
                scale_lengths(WindowSettings(size=32, overlap=0.75, top=96, bottom=192), SCALE),
            ),
            perspective=PerspectiveSettings(sizes=()),
        ),
        heat=HeatSettings(frames=2, threshold=1.4, votes=None),
        score=ScoreSettings(middle=1.4),
        min_score_still=0,
        min_size_still=(30 / WIDTH, 30 / HEIGHT),
    ),
    tracker=scale_lengths(RulesTrackerSettings(min_region=30, confident_peak=4), SCALE),
)
"""The original's way: sets over fixed rows, outlines, rules."""


def by_perspective(horizon: float | None, *sizes: float) -> Settings:
    """Give the default's way, for cars as large as `CAR`; without box regression votes agree less.

    Rows are right for a horizon of 0.5; at None it is looked for.
    """
    perspective = PerspectiveSettings(sizes=sizes, horizon=horizon)
    return Settings(
        detector=SvmSettings(
            stride=1,
            features=COLOUR,
            search=SearchSettings(probability=0.5, perspective=perspective),
            heat=HeatSettings(votes=0.5),
            score=ScoreSettings(middle=0.2, slope=4),
            min_score_still=0.835,
        )
    )


PERSPECTIVE = by_perspective(0.5, 0.15, 0.2)
THREE_SETS = by_perspective(0.5, 0.15, 0.2, 0.25)
"""With window sets of 48, 64 and 80 pixels; all of them find `CAR`."""


def red_finder() -> LinearModel:
    """Give a model that is sure of a window where 44 % of the pixels are bright red."""
    weights = np.zeros((1, COLOUR.length), np.float32)
    weights[0, COLOUR.hog_length + 2 * BINS - 1] = 1 / COLOUR.patch**2
    return LinearModel(
        COLOUR,
        weights,
        biases=np.array([-0.44], np.float32),
        slopes=np.array([-20], np.float32),
        offsets=np.zeros(1, np.float32),
    )


def red_model() -> SvmModel:
    """Give the detector that finds red cars the original's way."""
    return SvmModel(red_finder(), SETTINGS.svm)


def red_settings(folder: Path) -> Settings:
    """Give the same as settings, which name the file of the model in `folder`."""
    save_model(red_finder(), folder / "red.npz")
    detector = SETTINGS.svm.model_copy(update={"model": str(folder / "red.npz")})
    return SETTINGS.model_copy(update={"detector": detector})


def road(*boxes: Box) -> Image:
    """Draw red cars on a grey road."""
    image = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)
    for box in boxes:
        box.cut(image)[:] = (0, 0, 255)
    return image


def car_at(index: int) -> Box:
    """Tell where the car of `drive` is: it goes to the right, a pixel a frame."""
    return moved_to(CAR, 40 + index, CAR.y1)


def drive(count: int) -> Iterator[Frame]:
    """Give frames of a car that drives from left to right, 25 a second."""
    for index in range(count):
        yield Frame(index, Fraction(index, 25), Picture(road(car_at(index))))


class NullDetector:
    """A detector that finds nothing, in videos of any size."""

    def for_video(self, *_: object) -> Self:
        return self

    def search(self, picture: Picture, index: int | None) -> None:
        """Do nothing."""

    def detect(self, candidates: None) -> Boxes:  # noqa: ARG002
        return NO_BOXES
