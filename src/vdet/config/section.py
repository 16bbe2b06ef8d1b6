"""What every part of the settings is made of."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field


class _FrameLength:
    """Marks a length in pixels of a frame `reference_height` rows high (see `scaling`)."""


FRAME_LENGTH = _FrameLength()
Pixels = Annotated[int, Field(ge=0, le=100_000), FRAME_LENGTH]
Fraction = Annotated[float, Field(ge=0, le=1)]


class Section(BaseModel):
    """A part of the settings: unchangeable, unknown keys refused, no NaN."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
