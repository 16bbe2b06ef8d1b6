"""The section `adapt`: how `vdet adapt` fits the linear model to a camera."""

from typing import Annotated

from pydantic import Field

from vdet.config.section import Fraction, Section

_Tried = Annotated[tuple[Fraction, ...], Field(min_length=1, max_length=20)]


class AdaptSettings(Section):
    """How `vdet adapt` fits the linear model to a camera."""

    doubtful: Fraction = Field(
        0.15,
        description="detections of the teacher that no track needs are ignored from this score on; "
        "weaker ones count as background",
    )
    least_width: Fraction = Field(
        0.025, description="narrower vehicles are ignored, share of the frame's width"
    )
    check: float = Field(
        0.2, gt=0, lt=1, description="share of the footage, the last part, that is kept back"
    )
    frames: int = Field(
        100, ge=1, le=100_000, description="most frames that patches are cut out of"
    )
    rounds: int = Field(
        3, ge=1, le=20, description="most rounds of learning; each looks for new false alarms"
    )
    fewest: float = Field(
        0.05,
        ge=0,
        le=1,
        description="the last round is one with fewer new false alarms than this share of all",
    )
    weight: float = Field(
        1.0,
        gt=0,
        le=1000,
        description="factor of training.C: how much the patches change the model",
    )
    shares: _Tried = Field(
        (0.5, 1.0),
        description="shares of the change of the weights that are tried in the footage that was "
        "kept back",
    )
    probabilities: _Tried = Field(
        (0.7, 0.3),
        description="least probabilities of a hit that are tried with each of the shares; with a "
        "higher one, detection is faster",
    )
    tolerance: Fraction = Field(
        0.01,
        description="the first of these models is taken whose F1 is at most so much below the "
        "highest; a smaller difference may be chance",
    )
    penalty: float = Field(
        30.0,
        gt=0,
        le=1e6,
        description="ridge penalty of the regression of boxes, as training.boxes.penalty; higher, "
        "since one camera shows few different vehicles",
    )
