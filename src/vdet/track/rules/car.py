"""A car of the original system, and the regions in which it is detected."""

from collections import deque
from collections.abc import Mapping
from dataclasses import astuple, dataclass, field, replace
from statistics import fmean

import cv2
import numpy as np

from vdet.boxes import Box, Image
from vdet.config.kinds import RulesTrackerSettings
from vdet.polygons import Point
from vdet.track.votes import ClassVotes, vote_weight


@dataclass(frozen=True, slots=True)
class Region:
    """A detection inside the frame, in whole pixels; `peak` is its strength."""

    box: Box
    centroid: Point
    peak: float
    score: float = 1.0
    classes: Mapping[str, float] = field(default_factory=dict)

    def moved(self, x: float, y: float) -> "Region":
        """Return the region with the top left corner of its box moved to a point."""
        centroid = self.centroid[0] + x - self.box.x1, self.centroid[1] + y - self.box.y1
        box = Box.sized(x, y, self.box.width, self.box.height)
        return replace(self, box=box, centroid=centroid)


class Car:
    """A car, as the tracker remembers it.

    Every detection, by region or by match, adds a region, of which the last `history` are kept.
    `box`, `centroid` and `score` are their averages, so they exist from the first detection on.

    Attributes
    ----------
    id
        Assigned when the car is first shown; None before.
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
    box
        Average rectangle, rounded to whole pixels.
    centroid
        Average centroid, `(x, y)`.
    votes
        Votes of all its regions for its class.
    """

    box: Box
    centroid: Point

    def __init__(self, settings: RulesTrackerSettings, number: int | None = None) -> None:
        self._settings = settings
        self.id = number
        self.needed = settings.detections_needed
        self.in_a_row = self.count = self.matches = self.misses = 0
        self.votes = ClassVotes()
        self._seen: deque[Region] = deque(maxlen=settings.history)

    @property
    def score(self) -> float:
        """Average score, 0 to 1."""
        return fmean(region.score for region in self._seen)

    @property
    def is_shown(self) -> bool:
        """Whether it was detected for enough frames in a row, up to the latest (rule 14)."""
        return self.in_a_row >= self.needed

    @property
    def is_over(self) -> bool:
        """Whether there is a reason to delete it (rules 15, 16 and 17)."""
        is_young_and_missed = self.misses > 0 and self.count < self._settings.detections_to_keep
        is_only_matched = self.matches >= self._settings.max_matches
        return is_young_and_missed or is_only_matched or self.misses >= self._settings.max_misses

    def is_filled_by(self, region: Region) -> bool:
        """Return whether a region is wide enough to be the whole car (rules 7 and 8)."""
        minimum = min(self._settings.accepted_width, self._settings.good_fraction * self.box.width)
        return region.box.width > minimum

    def is_as_wide_as(self, region: Region) -> bool:
        """Return whether two combined regions are about as wide as the car (rules 9 and 10)."""
        width = self.box.width
        return abs(region.box.width - width) <= self._settings.combined_tolerance * width

    def see(self, region: Region, image: Image, *, by_match: bool = False) -> None:
        """Add a detection; its region lies inside the frame `image`."""
        self._image = region.box.cut(image).copy()
        if not by_match:
            box, size = np.array(astuple(region.box)), (image.shape[1], image.shape[0])
            self.votes.add(region.classes, vote_weight(box, region.score, size))
        self._seen.append(region)
        sides = zip(*(seen.box.xywh for seen in self._seen), strict=True)
        x, y, width, height = (round(fmean(values)) for values in sides)
        self.box = Box.sized(x, y, width, height)
        xs, ys = zip(*(seen.centroid for seen in self._seen), strict=True)
        self.centroid = fmean(xs), fmean(ys)
        self.matches = self.matches + 1 if by_match else 0
        self.in_a_row += 1
        self.count += 1
        self.misses = 0

    def miss(self) -> None:
        """Record a frame without a detection."""
        self.in_a_row = 0
        self.misses += 1

    def trust(self, peak: float) -> None:
        """Show the car sooner if the peak of its region is high (rules 6 and 11)."""
        if peak > self._settings.confident_peak:
            self.needed = min(self.needed, self._settings.confident_detections_needed)

    def vouch(self) -> None:
        """Count the car as detected often enough to be shown."""
        needed = self._settings.detections_needed
        self.in_a_row, self.count = max(self.in_a_row, needed), max(self.count, needed)

    def find_in(self, image: Image) -> Region | None:
        """Return the latest detection where its image fits the frame `image` best.

        It may have moved by up to `match_distance` pixels in a straight line; nothing farther away
        is searched. None if nothing scores `match_score`, and for an image of one colour, which
        fits any flat area.
        """
        last, distance = self._seen[-1], self._settings.match_distance
        if (self._image == self._image[0, 0]).all():
            return None
        x1, y1, x2, y2 = last.box.pixels
        around = Box(x1 - distance, y1 - distance, x2 + distance, y2 + distance)
        area = around.clipped(image.shape[1], image.shape[0])
        matches = cv2.matchTemplate(area.cut(image), self._image, cv2.TM_CCOEFF_NORMED)
        scores = np.asarray(matches, np.float32)
        dy, dx = np.ogrid[: scores.shape[0], : scores.shape[1]]
        scores[np.hypot(area.x1 + dx - x1, area.y1 + dy - y1) > distance] = -1
        y, x = np.unravel_index(int(scores.argmax()), scores.shape)
        if round(float(scores[y, x]), 4) < self._settings.match_score:  # a perfect fit: 0.9999998
            return None
        return last.moved(area.x1 + int(x), area.y1 + int(y))


def combine(first: Region, second: Region) -> Region:
    """Combine two regions: the box around both, centroids weighted by area, the higher peak."""
    a, b = first.box.area, second.box.area
    (x1, y1), (x2, y2) = first.centroid, second.centroid
    centroid = (x1 * a + x2 * b) / (a + b), (y1 * a + y2 * b) / (a + b)
    higher = max(first, second, key=lambda region: region.peak)
    return replace(higher, box=first.box.union(second.box), centroid=centroid)
