"""One car: where it was seen lately, and how sure of it we are.

Source: seed section 3, "Define a Car class".
"""

from collections import deque
from dataclasses import InitVar, dataclass, field
from statistics import fmean

from vdet.config.schema import TrackerSettings
from vdet.geometry import Box
from vdet.track.rules.template import Image, find

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Sighting:
    """A car in one frame: its rectangle and centroid in full-frame pixels, and that cut-out."""

    box: Box
    centroid: Point
    image: Image


@dataclass(eq=False, slots=True)
class Car:
    """What is remembered of a car.

    Every detection, by region or by match, adds a rectangle, a centroid and the image cut from
    that frame at the rectangle; the last `history` of each are kept. `box` and `centroid` are
    their averages, so they exist from the first detection on.

    Attributes
    ----------
    needed
        Detections in a row before the car is shown.
    id
        Given when the car is first shown; None tells that it never was.
    detected
        Whether it was detected in the latest frame.
    in_a_row
        Detections in a row up to the latest frame.
    detections
        Detections so far.
    matches
        How many of the latest detections, in a row, were template matches. Misses in between do
        not end the row, a region does.
    misses
        Frames in a row without a detection.
    """

    needed: int
    history: InitVar[int]
    id: int | None = None
    detected: bool = False
    in_a_row: int = 0
    detections: int = 0
    matches: int = 0
    misses: int = 0
    sightings: deque[Sighting] = field(init=False)

    def __post_init__(self, history: int) -> None:
        self.sightings = deque(maxlen=history)

    @property
    def box(self) -> Box:
        """Average rectangle, rounded to whole pixels."""
        boxes = [sighting.box for sighting in self.sightings]
        return Box(
            round(fmean(box.x for box in boxes)),
            round(fmean(box.y for box in boxes)),
            round(fmean(box.width for box in boxes)),
            round(fmean(box.height for box in boxes)),
        )

    @property
    def centroid(self) -> Point:
        """Average centroid, `(x, y)`."""
        xs, ys = zip(*(sighting.centroid for sighting in self.sightings), strict=True)
        return fmean(xs), fmean(ys)

    @property
    def is_shown(self) -> bool:
        """Whether it is detected in the latest frame and for enough frames in a row (rule 14)."""
        return self.detected and self.in_a_row >= self.needed

    def see(self, box: Box, centroid: Point, image: Image) -> None:
        """Add a detection by a region of the frame `image`; `box` lies in it."""
        self.matches = 0
        self._add(box, centroid, image)

    def see_match(self, box: Box, image: Image) -> None:
        """Add a detection by template match alone, in the frame `image`."""
        self.matches += 1
        self._add(box, self.centroid_at(box), image)

    def miss(self) -> None:
        """Note a frame without a detection."""
        self.detected = False
        self.in_a_row = 0
        self.misses += 1

    def need(self, detections: int) -> None:
        """Show the car after so many detections in a row, if that is sooner."""
        self.needed = min(self.needed, detections)

    def vouch(self, detections: int) -> None:
        """Count the car as detected at least so often already, and in a row."""
        self.in_a_row = max(self.in_a_row, detections)
        self.detections = max(self.detections, detections)

    def find_in(self, image: Image, settings: TrackerSettings) -> Box | None:
        """Look for the latest cut-out around the latest rectangle of the frame `image`."""
        last = self.sightings[-1]
        return find(
            image,
            last.image,
            last.box,
            distance=settings.match_distance,
            method=settings.match_method,
            min_score=settings.match_score,
        )

    def centroid_at(self, box: Box) -> Point:
        """Return the latest centroid, moved as the latest rectangle moved to `box`."""
        last = self.sightings[-1]
        x, y = last.centroid
        return x + box.x - last.box.x, y + box.y - last.box.y

    def _add(self, box: Box, centroid: Point, image: Image) -> None:
        cutout = image[box.y : box.bottom, box.x : box.right].copy()
        self.sightings.append(Sighting(box, centroid, cutout))
        self.detected = True
        self.in_a_row += 1
        self.detections += 1
        self.misses = 0
