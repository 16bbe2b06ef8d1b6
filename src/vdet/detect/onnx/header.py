"""The header of our own networks, JSON in the metadata of the ONNX file."""

from typing import Any, Literal

from pydantic import Field

from vdet.config.network import NetworkScoreSettings
from vdet.config.section import Section

HEADER_KEY = "vdet"
"""Key of the metadata that holds the header."""


class Header(Section):
    """What an ONNX file says of a network of ours."""

    format: Literal[1] = 1
    classes: tuple[str, ...] = Field(min_length=1, max_length=1000)
    pixels: int = Field(147_456, ge=1024, le=16_000_000, description="of the scaled frame")
    calibration: NetworkScoreSettings = NetworkScoreSettings()
    provenance: dict[str, Any] = Field(
        default={}, description="what it was trained on and how, and what it reached"
    )
