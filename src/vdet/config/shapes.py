"""What sections with places in the frame have in common: points, and the size they are given for.

Points are pixels of a frame of `size`, or shares of the frame where no size is given.
"""

from collections.abc import Iterable
from typing import Annotated

from pydantic import Field, field_validator

from vdet.config.section import Section
from vdet.errors import ConfigError
from vdet.polygons import Point, area_of, crosses_itself, unclosed

Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Place = tuple[Coordinate, Coordinate]
Name = Annotated[str, Field(min_length=1, max_length=80)]
Side = Annotated[int, Field(ge=1, le=100_000)]

MOST_CORNERS = 100
MOST_SHAPES = 100
_SAME_ASPECT = 0.01
"""Largest relative difference of the aspect ratios of a frame and of the reference size."""


class PlacedSection(Section):
    """A section with places in the frame."""

    size: tuple[Side, ...] = Field(
        (),
        max_length=2,
        description="width and height, pixels, of the frames in which the points are given; frames "
        "of another size but the same shape are fine; []: points are shares of the frame, 0 to 1",
    )

    @field_validator("size")
    @classmethod
    def _has_two_sides(cls, size: tuple[int, ...]) -> tuple[int, ...]:
        if len(size) == 1:
            raise ValueError("should be width and height, as in [1280, 720]")
        return size

    def scales(self, width: int, height: int) -> tuple[float, float]:
        """Return by what x and y are multiplied to be pixels of a frame of `width` × `height`.

        Raises
        ------
        ConfigError
            The frame has another aspect ratio than `size`.
        """
        if not self.size:
            return float(width), float(height)
        given_width, given_height = self.size
        aspect = (width / height) / (given_width / given_height)
        if abs(aspect - 1) > _SAME_ASPECT:
            raise ConfigError(
                f"size: places are given for frames of {given_width}×{given_height}, which have "
                f"another shape than {width}×{height}; give places for such frames"
            )
        return width / given_width, height / given_height

    def check_inside(self, what: str, points: Iterable[Point]) -> None:
        """Raise a `ValueError` if a point lies outside the frame; `what` it belongs to."""
        width, height = self.size or (1, 1)
        for x, y in points:
            if not (0 <= x <= width and 0 <= y <= height):
                unit = "" if self.size else "; shares are 0 to 1, and for pixels give size"
                raise ValueError(
                    f"{what}: the point [{x:g}, {y:g}] lies outside the frame of "
                    f"{width}×{height}{unit}"
                )


def check_names(names: Iterable[str]) -> None:
    """Raise a `ValueError` if a name is given twice."""
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise ValueError(f"{name}: this name is given twice; give each its own")
        seen.add(name)


class PolygonSection(Section):
    """A named polygon."""

    name: Name = Field(description="its name, which no other one has")
    points: tuple[Place, ...] = Field(
        max_length=MOST_CORNERS,
        description="corners in order, x and y; the last side leads back to the first corner",
    )

    @field_validator("points")
    @classmethod
    def _is_a_polygon(cls, points: tuple[Point, ...]) -> tuple[Point, ...]:
        corners = unclosed(points)
        if len(corners) < 3:
            raise ValueError(f"has {len(corners)} corners; give three or more")
        if crosses_itself(corners):
            raise ValueError("crosses or touches itself; give the corners in order around it")
        if area_of(corners) == 0:
            raise ValueError("has no area; give corners that do not lie on one line")
        return corners
