"""One car: where it was detected lately, and for how long.

Source: seed section 3, "Define a Car class".
"""

from collections import deque
from dataclasses import InitVar, dataclass, field, replace
from statistics import fmean, multimode

import cv2
import numpy as np

from vdet.boxes import Box
from vdet.config.schema import RulesTrackerSettings
from vdet.media.images import Image

Point = tuple[float, float]


_NO_IMAGE: Image = np.empty((0, 0, 3), np.uint8)


@dataclass(frozen=True, slots=True)
class Region:
    """A detection inside the frame, in whole pixels; `peak` is its strength.

    `image` is the part of the frame that it shows, once a car is detected there. A detection by
    match has the score and the class of the one before it.
    """

    box: Box
    centroid: Point
    peak: float
    score: float = 1.0
    class_name: str | None = None
    image: Image = field(default_factory=lambda: _NO_IMAGE, compare=False)


@dataclass(eq=False, slots=True)
class Car:
    """What is remembered of a car.

    Every detection, by region or by match, adds a rectangle, a centroid and the image cut from
    that frame at the rectangle; the last `history` of each are kept. `box`, `centroid` and `score`
    are their averages, so they exist from the first detection on.

    Attributes
    ----------
    needed
        Detections in a row before the car is shown.
    id
        Given when the car is first shown; None before.
    detected
        Whether it was detected in the latest frame.
    in_a_row
        Detections in a row up to the latest frame.
    count
        Boxes so far.
    matches
        How many of the latest detections, in a row, were template matches. Misses in between do
        not end the row, a region does.
    misses
        Frames in a row without a detection.
    detections
        The last `history` detections.
    """

    needed: int
    history: InitVar[int]
    id: int | None = None
    detected: bool = False
    in_a_row: int = 0
    count: int = 0
    matches: int = 0
    misses: int = 0
    detections: deque[Region] = field(init=False)

    def __post_init__(self, history: int) -> None:
        self.detections = deque(maxlen=history)

    @property
    def box(self) -> Box:
        """Average rectangle, rounded to whole pixels."""
        boxes = [detection.box for detection in self.detections]
        return Box.sized(
            round(fmean(box.x1 for box in boxes)),
            round(fmean(box.y1 for box in boxes)),
            round(fmean(box.width for box in boxes)),
            round(fmean(box.height for box in boxes)),
        )

    @property
    def centroid(self) -> Point:
        """Average centroid, `(x, y)`."""
        xs, ys = zip(*(detection.centroid for detection in self.detections), strict=True)
        return fmean(xs), fmean(ys)

    @property
    def score(self) -> float:
        """Average score, 0 to 1."""
        return fmean(detection.score for detection in self.detections)

    @property
    def class_name(self) -> str | None:
        """The most frequent class of the detections, the earliest one among equals."""
        return multimode(detection.class_name for detection in self.detections)[0]

    @property
    def is_shown(self) -> bool:
        """Whether it is detected in the latest frame and for enough frames in a row (rule 14)."""
        return self.detected and self.in_a_row >= self.needed

    def see(self, region: Region, image: Image) -> None:
        """Add a detection by a region of the frame `image`; the region lies in it."""
        self.matches = 0
        self._add(region, image)

    def see_match(self, box: Box, image: Image) -> None:
        """Add a detection by template match alone, in the frame `image`."""
        last = self.detections[-1]
        self.matches += 1
        self._add(Region(box, self.centroid_at(box), 0.0, last.score, last.class_name), image)

    def miss(self) -> None:
        """Note a frame without a detection."""
        self.detected = False
        self.in_a_row = 0
        self.misses += 1

    def need(self, detections: int) -> None:
        """Show the car after this number of detections in a row, if that is sooner."""
        self.needed = min(self.needed, detections)

    def count_at_least(self, detections: int) -> None:
        """Raise both counts of detections to this number where they are lower."""
        self.in_a_row = max(self.in_a_row, detections)
        self.count = max(self.count, detections)

    def find_in(self, image: Image, settings: RulesTrackerSettings) -> Box | None:
        """Search the latest cut-out around the latest rectangle of the frame `image`."""
        last = self.detections[-1]
        return find_template(
            image,
            last.image,
            last.box,
            distance=settings.match_distance,
            min_score=settings.match_score,
        )

    def centroid_at(self, box: Box) -> Point:
        """Return the latest centroid, moved as the latest rectangle moved to `box`."""
        last = self.detections[-1]
        x, y = last.centroid
        return x + box.x1 - last.box.x1, y + box.y1 - last.box.y1

    def _add(self, region: Region, image: Image) -> None:
        self.detections.append(replace(region, image=region.box.cut(image).copy()))
        self.detected = True
        self.in_a_row += 1
        self.count += 1
        self.misses = 0


def find_template(
    image: Image,
    template: Image,
    near: Box,
    *,
    distance: int,
    min_score: float,
) -> Box | None:
    """Return where `template` fits `image` best, if it fits well enough.

    Parameters
    ----------
    image, template
        BGR uint8 `(H, W, 3)`.
    near
        Where the template was in its own frame, full-frame pixels.
    distance
        How far its top left corner may have moved, pixels, in a straight line. Nothing outside
        `near` grown by this distance is searched.
    min_score
        0 to 1; 1 is a perfect fit.

    Returns
    -------
    The place, of the template's size and inside the image. None where nothing scores `min_score`,
    where the template does not fit into the searched area, and for a template of one colour,
    which fits anything flat.
    """
    height, width = template.shape[:2]
    grown = Box.sized(
        near.x1 - distance, near.y1 - distance, width + 2 * distance, height + 2 * distance
    )
    area = grown.clipped(image.shape[1], image.shape[0])
    if area.width < width or area.height < height or _is_flat(template):
        return None
    searched = area.cut(image)
    scores = np.asarray(cv2.matchTemplate(searched, template, cv2.TM_CCOEFF_NORMED), np.float32)
    dy, dx = np.ogrid[: scores.shape[0], : scores.shape[1]]
    scores[np.hypot(area.x1 + dx - near.x1, area.y1 + dy - near.y1) > distance] = -1
    y, x = np.unravel_index(int(scores.argmax()), scores.shape)
    if round(float(scores[y, x]), 4) < min_score:  # a perfect fit may score 0.9999998
        return None
    return Box.sized(area.x1 + int(x), area.y1 + int(y), width, height)


def _is_flat(image: Image) -> bool:
    return image.size == 0 or bool((image == image[0, 0]).all())
