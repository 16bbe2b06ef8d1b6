"""One car of the original system: where it was detected lately, and for how long."""

from collections import deque
from dataclasses import dataclass, field, replace
from statistics import fmean, multimode

import cv2
import numpy as np

from vdet.boxes import Box, Image
from vdet.config.tracker import RulesTrackerSettings

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


class Car:
    """What is remembered of a car.

    Every detection, by region or by match, adds a rectangle, a centroid and the image cut from
    that frame at the rectangle; the last `history` of each are kept. `box`, `centroid` and `score`
    are their averages, so they exist from the first detection on.

    Attributes
    ----------
    id
        Given when the car is first shown; None before.
    needed
        Detections in a row before the car is shown.
    in_a_row
        Detections in a row up to the latest frame.
    count
        Detections so far.
    matches
        How many of the latest detections, in a row, were template matches. Misses in between do
        not end the row, a region does.
    misses
        Frames in a row without a detection.
    detections
        The last `history` detections.
    """

    def __init__(self, settings: RulesTrackerSettings, number: int | None = None) -> None:
        self._settings = settings
        self.id = number
        self.needed = settings.detections_needed
        self.in_a_row = self.count = self.matches = self.misses = 0
        self.detections: deque[Region] = deque(maxlen=settings.history)

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
        """Whether it was detected for enough frames in a row, up to the latest (rule 14)."""
        return self.in_a_row >= self.needed

    @property
    def is_over(self) -> bool:
        """Whether there is a reason to delete it (rules 15, 16 and 17)."""
        is_young_and_missed = self.misses > 0 and self.count < self._settings.young
        is_only_matched = self.matches >= self._settings.max_matches
        return is_young_and_missed or is_only_matched or self.misses >= self._settings.max_misses

    def is_filled_by(self, region: Box) -> bool:
        """Return whether a region is wide enough to be all of the car (rules 7 and 8)."""
        least = min(self._settings.wide, self._settings.good_fraction * self.box.width)
        return region.width > least

    def is_as_wide_as(self, region: Box) -> bool:
        """Return whether two combined regions are about as wide as the car (rules 9 and 10)."""
        width = self.box.width
        return abs(region.width - width) <= self._settings.combined_tolerance * width

    def see(self, region: Region, image: Image) -> None:
        """Add a detection by a region of the frame `image`; the region lies in it."""
        self.matches = 0
        self._add(region, image)

    def see_match(self, box: Box, image: Image) -> None:
        """Add a detection by template match alone, in the frame `image`."""
        self.matches += 1
        self._add(replace(self.detections[-1], box=box, centroid=self.centroid_at(box)), image)

    def miss(self) -> None:
        """Note a frame without a detection."""
        self.in_a_row = 0
        self.misses += 1

    def trust(self, peak: float) -> None:
        """Show the car sooner if the peak of its region is high (rules 6 and 11)."""
        if peak > self._settings.confident_peak:
            self.needed = min(self.needed, self._settings.confident_detections_needed)

    def vouch(self) -> None:
        """Let it count as detected often enough to be shown."""
        self.in_a_row = max(self.in_a_row, self._settings.detections_needed)
        self.count = max(self.count, self._settings.detections_needed)

    def find_in(self, image: Image) -> Box | None:
        """Search the latest cut-out around the latest rectangle of the frame `image`."""
        return find_template(image, self.detections[-1], self._settings)

    def centroid_at(self, box: Box) -> Point:
        """Return the latest centroid, moved as the latest rectangle moved to `box`."""
        last = self.detections[-1]
        x, y = last.centroid
        return x + box.x1 - last.box.x1, y + box.y1 - last.box.y1

    def _add(self, region: Region, image: Image) -> None:
        self.detections.append(replace(region, image=region.box.cut(image).copy()))
        self.in_a_row += 1
        self.count += 1
        self.misses = 0


def find_template(image: Image, template: Region, settings: RulesTrackerSettings) -> Box | None:
    """Return where the image of a region fits `image` best, if it fits well enough.

    Parameters
    ----------
    image
        BGR uint8 `(H, W, 3)`.
    template
        Its top left corner may have moved by `match_distance` pixels in a straight line. Nothing
        outside its box, grown by this distance, is searched.

    Returns
    -------
    The place, of the template's size and inside the image. None where nothing scores
    `match_score`, where the template does not fit into the searched area, and for a template of
    one colour, which fits anything flat.
    """
    distance, near = settings.match_distance, template.box
    height, width = template.image.shape[:2]
    grown = Box.sized(
        near.x1 - distance, near.y1 - distance, width + 2 * distance, height + 2 * distance
    )
    area = grown.clipped(image.shape[1], image.shape[0])
    if area.width < width or area.height < height or _is_flat(template.image):
        return None
    found = cv2.matchTemplate(area.cut(image), template.image, cv2.TM_CCOEFF_NORMED)
    scores = np.asarray(found, np.float32)
    dy, dx = np.ogrid[: scores.shape[0], : scores.shape[1]]
    scores[np.hypot(area.x1 + dx - near.x1, area.y1 + dy - near.y1) > distance] = -1
    y, x = np.unravel_index(int(scores.argmax()), scores.shape)
    if round(float(scores[y, x]), 4) < settings.match_score:  # a perfect fit may score 0.9999998
        return None
    return Box.sized(area.x1 + int(x), area.y1 + int(y), width, height)


def _is_flat(image: Image) -> bool:
    return image.size == 0 or bool((image == image[0, 0]).all())
