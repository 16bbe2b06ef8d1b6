"""The header of our own networks, JSON in the metadata of the ONNX file."""

from typing import Any, Literal

from pydantic import Field

from vdet.config.section import Section

HEADER_KEY = "vdet"
"""Key of the metadata that holds the header."""


class ScoreCalibration(Section):
    """Score of a box: sigmoid(slope · x + offset), where x is the output of the network.

    It is the share of boxes with such an output that show a vehicle, fitted on cameras that were
    left out of the training.
    """

    slope: float = Field(1.0, gt=0)
    offset: float = 0.0


class Header(Section):
    """What an ONNX file says of a network of ours."""

    format: Literal[1] = 1
    classes: tuple[str, ...] = Field(min_length=1, max_length=1000)
    pixels: int = Field(147_456, ge=1024, le=16_000_000, description="of the scaled frame")
    calibration: ScoreCalibration = ScoreCalibration()
    provenance: dict[str, Any] = Field(
        default={}, description="what it was trained on and how, and what it reached"
    )
