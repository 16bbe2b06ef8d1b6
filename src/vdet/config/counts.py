"""The section `counts`: lines and zones at which vehicles are counted, and the rule of counting."""

from pydantic import Field, model_validator

from vdet.config.section import Section, Share
from vdet.config.shapes import MOST_SHAPES, Name, Place, PlacedSection, PolygonSection, check_names


class LineSettings(Section):
    """A line; crossings are counted by direction."""

    name: Name = Field(description="its name, which no other one has")
    start: Place = Field(description="where it starts, x and y")
    end: Place = Field(description="where it ends, x and y")
    left: Name = Field(
        "left",
        description="name of the direction to the left of someone who looks from start to end",
    )
    right: Name = Field("right", description="name of the direction to the right")

    @model_validator(mode="after")
    def _has_a_length_and_two_directions(self) -> "LineSettings":
        if self.start == self.end:
            raise ValueError("start and end are one point; give two")
        if self.left == self.right:
            raise ValueError("left and right have one name; give each its own")
        return self


class ZoneSettings(PolygonSection):
    """A zone; vehicles that enter, leave and stay are counted."""


class CountSettings(PlacedSection):
    """Lines and zones at which vehicles are counted (`vdet.traffic` explains the rule)."""

    lines: tuple[LineSettings, ...] = Field(
        (), max_length=MOST_SHAPES, description="lines ([] for none)"
    )
    zones: tuple[ZoneSettings, ...] = Field(
        (), max_length=MOST_SHAPES, description="zones ([] for none)"
    )
    drawn: bool = Field(
        False, description="draw lines and zones with their running counts into the video"
    )
    band: float = Field(
        0.05,
        ge=0,
        le=1,
        description="a vehicle this near a line or a border is on neither side, heights of its box",
    )
    least_band: Share = Field(
        0.003, description="but at least this near, share of the frame's height"
    )
    settled: float = Field(
        0.1,
        ge=0,
        le=10,
        description="seconds after which a vehicle beyond that is on the other side; one height "
        "away it is at once",
    )
    confirmed: float = Field(
        0.2, ge=0, le=10, description="vehicles that are seen for fewer seconds do not count"
    )
    gap: float = Field(
        1.0,
        ge=0,
        le=10,
        description="a vehicle that is first seen within so many seconds of another one's end, and "
        "where that one would be, is the same",
    )

    def __bool__(self) -> bool:
        return bool(self.lines or self.zones)

    @model_validator(mode="after")
    def _lie_in_the_frame(self) -> "CountSettings":
        check_names([line.name for line in self.lines] + [zone.name for zone in self.zones])
        for line in self.lines:
            self.check_inside(line.name, (line.start, line.end))
        for zone in self.zones:
            self.check_inside(zone.name, zone.points)
        return self
