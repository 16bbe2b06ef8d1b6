"""The sections `input`, `output`, `crops` and `draw`: what is read, written and drawn."""

from typing import Annotated, Literal

from pydantic import Field

from vdet.config.section import Section, Share

LabelPart = Literal["id", "class", "score", "distance"]
Seconds = Annotated[float, Field(gt=0, le=60)]


class InputSettings(Section):
    """The video that is read."""

    max_damaged: Share = 0.05
    """Largest accepted share of damaged or lost frames."""
    frame_rate: float | None = Field(None, ge=0.01, le=1000)
    """Frames per second of numbered pictures (img_%04d.png). null: 25, with a warning."""


class OutputSettings(Section):
    """The video that is written, in H.264."""

    preset: Literal["ultrafast", "superfast", "veryfast", "faster", "fast", "medium", "slow"] = (
        "superfast"
    )
    """Speed of the encoder. Slower presets write smaller files."""
    crf: int = Field(25, ge=0, le=51)
    """Quality: 0 is the best, 51 the worst."""


class CropSettings(Section):
    """The best picture of each vehicle."""

    format: Literal["jpg", "png"] = "jpg"
    """File format."""


class DrawSettings(Section):
    """What is drawn on videos and pictures."""

    boxes: bool = True
    """Draw a box around each vehicle."""
    predicted: Literal["dashed", "plain", "hidden"] = "dashed"
    """How to draw vehicles that are predicted, not detected: with dashed boxes, with plain boxes,
    or not at all.
    """
    label: tuple[LabelPart, ...] | None = Field(None, max_length=4)
    """Parts of the label in order: id, class, score, distance. Unknown ones are left out. []: no
    labels. null: the id in a video, the score in a picture.
    """
    colors: Literal["id", "class", "region", "one"] = "id"
    """Use one colour for each id, for each class, for each polygon of the section regions, or for
    all vehicles (one).
    """
    thickness: float = Field(1.0, gt=0, le=20)
    """Factor of the width of lines, which otherwise depends on the frame."""
    trails: Seconds | None = None
    """Draw the path of each vehicle over this many seconds of a video."""
    time: bool = False
    """Draw the time since the first frame of a video."""
    smoothing: Seconds | None = 0.4
    """Smooth the boxes drawn into a video over this many seconds. null: do not."""
