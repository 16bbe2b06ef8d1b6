"""A car of the original system, and which region of a frame belongs to which (rules 2 to 11).

Where the description of the original system can be read in two ways, this is the choice:

* A car is in a region if its average centroid lies in the region's bounding box. A car has at most
  one place in a frame; regions are taken in the order given.
* Regions with cars in them come first, then those without, so that no car is lost from its own
  region to a neighbour. All positions are those before this frame.
* Of several cars in a region only those count that the template match confirms. If that leaves
  one, the region belongs to that car alone; if it leaves none, to the car whose centroid is
  nearest.
* If any two of the confirmed cars overlap, all become one, because the new car takes the whole
  region. Cars that stay apart also take their rectangle from the match, at their old size, and
  count as detected by region, because the heat covers their places.
* One car and a region that is not of good size: the region is not added, and the car is left
  without one (it may yet be found by match). Such a region is a piece of that car: it makes no new
  car, but may be combined with another one.
* The distance of a car and a region is the gap between the car's average rectangle and the
  region's. Of several near cars, one without a place goes first, then the nearest.
* Combined regions that are not about the car's size are not parts of it: the region is judged
  alone. A near region that is not of good size is ignored, unless the car has a region of its own
  already: then it belongs to another car, and becomes a new one.
* A car made of others keeps the lowest id that was shown among them. Of the two cars that one
  becomes, the one nearer to its centroid keeps the id.
"""

import math
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass, field, replace
from itertools import combinations
from statistics import fmean

import cv2
import numpy as np

from vdet.boxes import Box, Image
from vdet.config.tracker import RulesTrackerSettings
from vdet.track.votes import ClassVotes, vote_weight

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Region:
    """A detection inside the frame, in whole pixels; `peak` is its strength."""

    box: Box
    centroid: Point
    peak: float
    score: float = 1.0
    classes: Mapping[str, float] = field(default_factory=dict)

    def moved(self, x: float, y: float) -> "Region":
        """Return it with the top left corner of its box at another place."""
        centroid = self.centroid[0] + x - self.box.x1, self.centroid[1] + y - self.box.y1
        box = Box.sized(x, y, self.box.width, self.box.height)
        return replace(self, box=box, centroid=centroid)


class Car:
    """What is remembered of a car.

    Every detection, by region or by match, adds a region, of which the last `history` are kept.
    `box`, `centroid` and `score` are their averages, so they exist from the first detection on.

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
    box
        Average rectangle, rounded to whole pixels.
    centroid
        Average centroid, `(x, y)`.
    votes
        Its class, by what all regions say.
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
        is_young_and_missed = self.misses > 0 and self.count < self._settings.young
        is_only_matched = self.matches >= self._settings.max_matches
        return is_young_and_missed or is_only_matched or self.misses >= self._settings.max_misses

    def is_filled_by(self, region: Region) -> bool:
        """Return whether a region is wide enough to be all of the car (rules 7 and 8)."""
        minimum = min(self._settings.wide, self._settings.good_fraction * self.box.width)
        return region.box.width > minimum

    def is_as_wide_as(self, region: Region) -> bool:
        """Return whether two combined regions are about as wide as the car (rules 9 and 10)."""
        width = self.box.width
        return abs(region.box.width - width) <= self._settings.combined_tolerance * width

    def see(self, region: Region, image: Image, *, by_match: bool = False) -> None:
        """Add a detection in the frame `image`; the region lies in it."""
        self._image = region.box.cut(image).copy()
        if not by_match:
            size = image.shape[1], image.shape[0]
            weight = vote_weight(np.array(astuple(region.box)), region.score, size)
            self.votes.add(region.classes, weight)
        self._seen.append(region)
        sides = zip(*(region.box.xywh for region in self._seen), strict=True)
        self.box = Box.sized(*(round(fmean(values)) for values in sides))
        xs, ys = zip(*(region.centroid for region in self._seen), strict=True)
        self.centroid = fmean(xs), fmean(ys)
        self.matches = self.matches + 1 if by_match else 0
        self.in_a_row += 1
        self.count += 1
        self.misses = 0

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

    def find_in(self, image: Image) -> Region | None:
        """Return the latest detection where its image fits the frame `image` best.

        It may have moved by `match_distance` pixels in a straight line; nothing farther around it
        is searched. None where nothing scores `match_score`, and for an image of one colour, which
        fits anything flat.
        """
        last, distance = self._seen[-1], self._settings.match_distance
        if (self._image == self._image[0, 0]).all():
            return None
        x1, y1, x2, y2 = last.box.pixels
        around = Box(x1 - distance, y1 - distance, x2 + distance, y2 + distance)
        area = around.clipped(image.shape[1], image.shape[0])
        found = cv2.matchTemplate(area.cut(image), self._image, cv2.TM_CCOEFF_NORMED)
        scores = np.asarray(found, np.float32)
        dy, dx = np.ogrid[: scores.shape[0], : scores.shape[1]]
        scores[np.hypot(area.x1 + dx - x1, area.y1 + dy - y1) > distance] = -1
        y, x = np.unravel_index(int(scores.argmax()), scores.shape)
        if round(float(scores[y, x]), 4) < self._settings.match_score:  # a perfect fit: 0.9999998
            return None
        return last.moved(area.x1 + int(x), area.y1 + int(y))


class Association:
    """Assigns the regions of one frame to cars, which get ids and counts, but no detections yet.

    Parameters
    ----------
    cars
        The cars known so far, each detected at least once.
    regions
        Regions of the frame, inside the frame and large enough.
    image
        The frame, BGR uint8 `(H, W, 3)`.
    settings
        Lengths already scaled to the frame.

    Attributes
    ----------
    cars
        The cars after this frame: those known that live on, then those created.
    places
        The cars that have a place in this frame; its `box` and `centroid` are the detection.
    """

    def __init__(
        self,
        cars: Sequence[Car],
        regions: Sequence[Region],
        image: Image,
        settings: RulesTrackerSettings,
    ) -> None:
        self.cars = list(cars)
        self.places: dict[Car, Region] = {}
        self._created: list[Car] = []
        self._unused = list(regions)
        self._image = image
        self._settings = settings
        without_car = [region for region in regions if not self._place_inside(region)]
        for region in without_car:
            if region in self._unused:
                self._place_near(region)
        self.cars += self._created

    def _place_inside(self, region: Region) -> bool:
        """Rules 2 to 7; False where no car is inside the region."""
        inside = [
            car for car in self.cars if car not in self.places and region.box.contains(car.centroid)
        ]
        found = {car: car.find_in(self._image) for car in inside} if len(inside) > 1 else {}
        matches = {car: match for car, match in found.items() if match is not None}
        if len(matches) > 1:
            self._merge_or_separate(region, matches)
        elif inside:
            car = min(matches or inside, key=lambda match: _distance(match, region))
            car.trust(region.peak)
            if car.is_filled_by(region):
                self._place(car, region)
        return bool(inside)

    def _merge_or_separate(self, region: Region, matches: dict[Car, Region]) -> None:
        """Rules 4 and 5."""
        if _any_overlap(matches.values(), self._settings.merge_overlap):
            ids = [car.id for car in matches if car.id is not None]
            self._forget(*matches)
            self._create(region, min(ids, default=None)).vouch()
            return
        for car, match in matches.items():
            place = replace(region, box=match.box, centroid=match.centroid)
            self._place(car, place, region)

    def _place_near(self, region: Region) -> None:
        """Rules 8 to 11."""
        gaps = {car: car.box.gap(region.box) for car in self.cars}
        car = min(
            (car for car, gap in gaps.items() if gap <= self._settings.near),
            key=lambda car: (car in self.places, gaps[car], _distance(car, region)),
            default=None,
        )
        if car is not None and self._place_combined(region, car):
            return
        if car is None or car in self.places:
            self._create(region).trust(region.peak)
        elif car.is_filled_by(region):
            self._place(car, region)

    def _place_combined(self, region: Region, car: Car) -> bool:
        """Rules 9 and 10; False where no other region makes up the car together with this one."""
        near = [
            other
            for other in self._unused
            if other is not region and car.box.gap(other.box) <= self._settings.near
        ]
        nearest = min(near, key=lambda other: _distance(car, other), default=None)
        other = self.places.get(car, nearest)
        if other is None or not car.is_as_wide_as(combined := combine(region, other)):
            return False
        if combined.box.width < self._settings.max_combined:
            self._place(car, combined, region, other)
            return True
        self._forget(car)
        closer, farther = sorted((region, other), key=lambda item: _distance(car, item))
        self._create(closer, car.id).vouch()
        self._create(farther).vouch()
        return True

    def _create(self, region: Region, number: int | None = None) -> Car:
        car = Car(self._settings, number)
        self._created.append(car)
        self._place(car, region)
        return car

    def _forget(self, *cars: Car) -> None:
        for car in cars:
            self.cars.remove(car)
            self.places.pop(car, None)

    def _place(self, car: Car, place: Region, *parts: Region) -> None:
        """Give the car a place, made of these regions; without them it is a region itself."""
        self.places[car] = place
        self._unused = [item for item in self._unused if item not in (parts or (place,))]


def _distance(car: Car, region: Region) -> float:
    return math.dist(car.centroid, region.centroid)


def combine(first: Region, second: Region) -> Region:
    """Return the two as one: box around both, centroids weighted by box area, the higher peak."""
    one, two = first.box.area, second.box.area
    (x1, y1), (x2, y2) = first.centroid, second.centroid
    centroid = (x1 * one + x2 * two) / (one + two), (y1 * one + y2 * two) / (one + two)
    higher = max(first, second, key=lambda region: region.peak)
    return replace(higher, box=first.box.union(second.box), centroid=centroid)


def _any_overlap(regions: Iterable[Region], pixels: int) -> bool:
    """Return whether two regions overlap by more than `pixels`, across and down (rule 4)."""
    common = (one.box.intersection(other.box) for one, other in combinations(regions, 2))
    return any(box.width > pixels and box.height > pixels for box in common)
