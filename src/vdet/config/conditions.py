"""The section `conditions`: which findings about a video are left out."""

from typing import Literal

from pydantic import Field

from vdet.config.section import Section

Code = Literal[
    "camera-moves", "camera-moved", "unexplained-motion", "dark", "haze", "blur",
    "lane-geometry", "classes", "small-frames",
]  # fmt: skip
"""What makes a result doubtful; docs/conditions.md explains each."""


class ConditionSettings(Section):
    """What makes a result doubtful: the findings about a video."""

    ignore: tuple[Code, ...] = Field((), max_length=100)
    """Codes of findings to leave out: camera-moves, camera-moved, unexplained-motion, dark, haze,
    blur, lane-geometry, classes, small-frames.
    """
