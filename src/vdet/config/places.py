"""The sections `regions` and `counts`: places in the frame.

Points are pixels of a frame of `size`, or shares of the frame where no size is given.
"""

from collections.abc import Iterable
from typing import Annotated, ClassVar, Literal

from pydantic import Field, field_validator, model_validator

from vdet.config.section import Section
from vdet.errors import ConfigError
from vdet.polygons import Point, crosses_itself

Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Place = tuple[Coordinate, Coordinate]
Side = Annotated[int, Field(ge=1, le=100_000)]
Name = Annotated[str, Field(min_length=1, max_length=80)]

MOST_CORNERS = 100
MOST_SHAPES = 100
SHORTEST_LINE = 0.01
"""Length of the shortest line, as a share of the frame's width or height."""
_SAME_ASPECT = 0.01
"""Largest relative difference of the aspect ratios of a frame and of the reference size."""


class PlacedSection(Section):
    """A section with places in the frame; errors name its keys behind `prefix`."""

    prefix: ClassVar[str] = ""

    size: tuple[Side, Side] | None = None
    """Width and height in pixels of the frames that the points are for. Frames of another size are
    fine if they have the same aspect ratio. null: points are shares of the frame, 0 to 1.
    """

    def scales(self, width: int, height: int) -> tuple[float, float]:
        """Return the factors that turn x and y into pixels of a frame of `width` × `height`.

        Raises
        ------
        ConfigError
            The frame has another aspect ratio than `size`.
        """
        if self.size is None:
            return float(width), float(height)
        given_width, given_height = self.size
        aspect = (width / height) / (given_width / given_height)
        if abs(aspect - 1) > _SAME_ASPECT:
            raise ConfigError(
                f"{self.prefix}size: places are given for frames of {given_width}×{given_height}, "
                f"which have another shape than {width}×{height}; give places for such frames"
            )
        return width / given_width, height / given_height

    def check_places(self, places: Iterable[tuple[str, Iterable[Point]]]) -> None:
        """Raise a `ValueError` if a name is given twice, or a point is not in the frame."""
        width, height = self.size or (1, 1)
        seen: set[str] = set()
        for name, points in places:
            if name in seen:
                raise ValueError(f"{name}: this name is given twice; give each its own")
            seen.add(name)
            for x, y in points:
                if not (0 <= x <= width and 0 <= y <= height):
                    unit = "" if self.size else "; shares are 0 to 1, and for pixels give size"
                    raise ValueError(f"{name}: [{x:g}, {y:g}] lies outside {width}×{height}{unit}")


class PolygonSection(Section):
    """A named polygon."""

    name: Name
    """Name, different from all others."""
    points: tuple[Place, ...] = Field(max_length=MOST_CORNERS)
    """Corners in order, x and y. The last one is joined to the first."""

    @field_validator("points")
    @classmethod
    def _is_a_polygon(cls, points: tuple[Point, ...]) -> tuple[Point, ...]:
        is_closed = len(points) > 1 and points[0] == points[-1]
        corners = points[:-1] if is_closed else points
        if len(corners) < 3:
            raise ValueError(f"has {len(corners)} corners; give three or more")
        if crosses_itself(corners):
            raise ValueError("crosses or touches itself; give the corners in order around it")
        return corners


class RegionSettings(PolygonSection):
    """A polygon in which vehicles are shown, or not."""

    kind: Literal["include", "exclude"] = "include"
    """include: vehicles in it are shown. exclude: they are not, even inside an included polygon."""


class RegionsSettings(PlacedSection):
    """Regions of the frame in which vehicles are shown.

    A vehicle is where the middle of its lower edge is. Without an included polygon and without a
    mask, the whole frame counts, except for excluded polygons.
    """

    prefix: ClassVar[str] = "regions."

    polygons: tuple[RegionSettings, ...] = Field((), max_length=MOST_SHAPES)
    """Polygons."""
    mask: str | None = Field(None, min_length=1, max_length=4096)
    """Picture with the aspect ratio of the frame. Vehicles are shown where it is white, and not
    where it is black.
    """

    def __bool__(self) -> bool:
        return bool(self.polygons or self.mask)

    @model_validator(mode="after")
    def _lie_in_the_frame(self) -> "RegionsSettings":
        self.check_places((each.name, each.points) for each in self.polygons)
        return self


class LineSettings(Section):
    """A line; crossings are counted by direction."""

    name: Name
    """Name, different from all others."""
    start: Place
    """Start, x and y."""
    end: Place
    """End, x and y."""
    left: Name = "left"
    """Name of the direction to the left, from the start."""
    right: Name = "right"
    """Name of the direction to the right."""

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

    prefix: ClassVar[str] = "counts."

    lines: tuple[LineSettings, ...] = Field((), max_length=MOST_SHAPES)
    """Lines."""
    zones: tuple[ZoneSettings, ...] = Field((), max_length=MOST_SHAPES)
    """Zones."""
    drawn: bool = False
    """Draw the lines and zones with their running counts into the video."""
    confirmed: float = Field(0.2, ge=0, le=10)
    """Ignore vehicles that are detected for fewer seconds than this."""

    def __bool__(self) -> bool:
        return bool(self.lines or self.zones)

    @model_validator(mode="after")
    def _lie_in_the_frame(self) -> "CountSettings":
        lines = [(line.name, (line.start, line.end)) for line in self.lines]
        self.check_places([*lines, *((zone.name, zone.points) for zone in self.zones)])
        for line in self.lines:
            sides = zip(line.start, line.end, self.size or (1, 1), strict=True)
            if all(abs(start - end) < SHORTEST_LINE * side for start, end, side in sides):
                raise ValueError(f"{line.name}: is shorter than 1 % of the frame; make it longer")
        return self
