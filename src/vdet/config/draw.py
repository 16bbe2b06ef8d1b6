"""The section `draw`: what is drawn on the video that is written, and on pictures."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from vdet.config.section import Section

AUTO: Literal["auto"] = "auto"
LabelPart = Literal["auto", "id", "class", "score", "distance"]
Seconds = Annotated[float, Field(ge=0, le=60)]


class DrawSettings(Section):
    """What is drawn on the video that is written, and on pictures."""

    boxes: bool = Field(True, description="draw a box around each vehicle")
    predicted: Literal["dashed", "plain", "hidden"] = Field(
        "dashed",
        description="vehicles that the detector did not see: dashed boxes, boxes as of the others, "
        "or not drawn at all",
    )
    label: tuple[LabelPart, ...] = Field(
        (AUTO,),
        max_length=5,
        description="what the label of a vehicle shows, in this order: id, class, score, distance "
        "(those that are known); [] for no labels; [auto]: id in a video, id and score in a "
        "picture",
    )
    colors: Literal["id", "class", "region", "one"] = Field(
        "id",
        description="what has a colour of its own: each id, each class, each polygon of the "
        "section regions; one: all are alike",
    )
    thickness: float = Field(
        1.0, gt=0, le=20, description="factor of the width of lines, which follows from the frame"
    )
    trails: Seconds = Field(
        0.0,
        description="in a video, the path of each vehicle in so many latest seconds; 0 for none",
    )
    time: bool = Field(
        False, description="in a video, the time since its first frame, at the lower left"
    )
    smoothing: Seconds = Field(
        0.4,
        description="in a video, boxes are smoothed over so many latest seconds as they are drawn; "
        "0 for not at all",
    )

    @model_validator(mode="after")
    def _automatic_alone(self) -> "DrawSettings":
        if AUTO in self.label and len(self.label) > 1:
            raise ValueError("label: auto stands alone; name the parts instead")
        return self
