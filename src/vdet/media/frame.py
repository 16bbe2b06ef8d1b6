"""A frame of a video, and what is known of a video: given by the reader, taken by the writer."""

from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

from vdet.media.coding import Coding
from vdet.media.images import Image
from vdet.media.orientation import Orientation
from vdet.media.planes import Picture

UNSPECIFIED = 2  # in each of the three code tables of ITU-T H.273


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One frame of a video.

    `index` counts all frames of the file from 0. `time` is the exact presentation time in seconds
    as the file has it (its first frame need not be at 0).
    """

    index: int
    time: Fraction
    picture: Picture

    @property
    def image(self) -> Image:
        """The picture as BGR uint8 `(H, W, 3)`."""
        return self.picture.image


@dataclass(frozen=True, slots=True)
class ColorTags:
    """How the colours of a video are coded, in codes of ITU-T H.273."""

    primaries: int = UNSPECIFIED
    transfer: int = UNSPECIFIED
    matrix: int = UNSPECIFIED


@dataclass(frozen=True, slots=True)
class Tags:
    """What a file says of the recording, as it says it; None where it says nothing."""

    creation_time: str | None = None
    location: str | None = None
    title: str | None = None


@dataclass(frozen=True, slots=True)
class VideoInfo:
    """What is known of a video before its frames are read.

    `width` and `height` are of the upright picture in pixels. `rate` is the average in frames per
    second (25 where the file gives none), `time_base` the unit of the file's times in seconds,
    `start` the time of the first frame. `frames` and `duration` (seconds) are what the file
    declares, or an estimate: not exact, None where unknown. `orientation` says how the coded
    picture was turned to stand upright. `pixel_aspect` is the width of an upright pixel over its
    height. `color` is of the images: where the file is HDR (PQ or HLG), they are BT.709.
    `coding` is that of the planes of the frames which come so, and of a video that is made of them.
    """

    path: Path
    width: int
    height: int
    rate: Fraction
    time_base: Fraction
    start: Fraction = Fraction(0)
    frames: int | None = None
    duration: Fraction | None = None
    orientation: Orientation = field(default_factory=Orientation)
    pixel_aspect: Fraction = Fraction(1)
    color: ColorTags = ColorTags()
    coding: Coding = field(default_factory=Coding)
    has_sound: bool = False
    tags: Tags = Tags()
