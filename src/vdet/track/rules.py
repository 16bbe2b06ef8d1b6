"""The rules tracker: cars are followed from frame to frame by rules 1 to 17 of the original.

Where the description of the original system can be read in two ways, this is the choice:

* A car is in a region if its average centroid lies in the region's bounding box. A car is assigned
  at most one region in a frame; regions are taken in the order of the detections.
* Regions with cars in them come first, then those without, so that no car is lost from its own
  region to a neighbour. All positions are those before this frame.
* Of several cars in a region only those count that the template match confirms. If that leaves
  one, the region belongs to that car alone; if it leaves none, to the car whose centroid is
  nearest.
* If any two of the confirmed cars overlap, all become one, because the new car takes the whole
  region. Cars that stay apart also take their rectangle from the match, at their old size, and
  count as detected by region, because the heat covers them.
* One car and a region that is not of good size: the region is not added, and the car is left
  without one (it may yet be found by match). Such a region is a piece of that car: it makes no new
  car, but may be combined with another one.
* The distance of a car and a region is the gap between the car's average rectangle and the
  region's. Of several cars near it, one without a region goes first, then the nearest.
* Combined regions that are not about the car's size are not parts of it: the region is judged
  alone. A region near a car that is not of good size is ignored, unless the car already has a
  region: then it belongs to another car, and becomes a new one.
* A car made of others keeps the lowest id that was shown among them. Of the two cars that one
  becomes, the one nearer to its centroid keeps the id.
* A car counts as shown before if it ever was, not only in the frame before.
* "In a row" is up to this frame: a car that is missed once is counted from the start again.
* The car that absorbs another one is detected by region in this frame, and the other's average
  centroid lies in its average rectangle. It keeps its id, or takes the other's if it has none yet.
* The searched image is the latest one, around the latest rectangle.
* A car found by match for the last time allowed is deleted in that frame, and not shown in it.
"""

import math
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass, field, replace
from itertools import combinations, count
from statistics import fmean

import cv2
import numpy as np

from vdet.boxes import Box, Boxes, Image
from vdet.config.kinds import RulesTrackerSettings
from vdet.config.section import REFERENCE_HEIGHT, scale_lengths
from vdet.errors import ArgumentError
from vdet.media import Picture
from vdet.polygons import Point
from vdet.track.track import ClassVotes, State, Track, vote_weight


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


class RulesTracker:
    """Tracks the cars of one video. Make a new one for every video: ids start at 1.

    Parameters
    ----------
    settings
        With lengths already scaled to the frame.

    Attributes
    ----------
    cars
        All cars so far, each detected at least once.
    assigned
        The region assigned to each car detected in the latest frame.
    """

    def __init__(self, settings: RulesTrackerSettings) -> None:
        self._settings = settings
        self.cars: list[Car] = []
        self.assigned: dict[Car, Region] = {}
        self._created: list[Car] = []
        self._unused: list[Region] = []
        self._ids = count(1)

    def update(self, detections: Boxes, time: float, picture: Picture | None = None) -> list[Track]:  # noqa: ARG002 - the rules count frames
        """Follow the cars into the next frame, as `VideoTracker.update`; `picture` is required."""
        if picture is None:
            raise ArgumentError("image: the rules tracker needs the frame; pass it")
        regions = large_enough(detections, picture.width, picture.height, self._settings)
        self.associate(regions, picture.image)
        for car, region in self.assigned.items():
            car.see(region, picture.image)
        for car in [car for car in self.cars if car not in self.assigned]:
            if not self._absorb(car):
                self._search(car, picture.image)
        self.cars = [car for car in self.cars if not car.is_over]
        shown = [car for car in self.cars if car.is_shown]
        return sorted((self._track(car) for car in shown), key=lambda track: track.id)

    def associate(self, regions: Sequence[Region], image: Image) -> None:
        """Assign the regions of the next frame to cars, old and new ones (rules 2 to 11).

        The regions lie inside the frame `image`, BGR uint8 `(H, W, 3)`, and are large enough. Cars
        get regions, ids and counts, but no detections yet.
        """
        self.assigned, self._created, self._unused = {}, [], list(regions)
        for region in [region for region in regions if not self._assign_inside(region, image)]:
            if region in self._unused:
                self._assign_nearby(region)
        self.cars += self._created

    def _assign_inside(self, region: Region, image: Image) -> bool:
        """Rules 2 to 7; False where no car is inside the region."""
        inside = [
            car
            for car in self.cars
            if car not in self.assigned and region.box.contains(car.centroid)
        ]
        searched = inside if len(inside) > 1 else []
        matches = {car: match for car in searched if (match := car.find_in(image))}
        if len(matches) > 1:
            self._merge_or_separate(region, matches)
        elif inside:
            car = min(matches or inside, key=lambda match: _distance(match, region))
            car.trust(region.peak)
            if car.is_filled_by(region):
                self._assign(car, region)
        return bool(inside)

    def _merge_or_separate(self, region: Region, matches: dict[Car, Region]) -> None:
        """Rules 4 and 5."""
        if _any_overlap(matches.values(), self._settings.merge_overlap):
            ids = [car.id for car in matches if car.id is not None]
            self._forget(*matches)
            self._create(region, min(ids, default=None)).vouch()
            return
        for car, match in matches.items():
            self._assign(car, replace(region, box=match.box, centroid=match.centroid), region)

    def _assign_nearby(self, region: Region) -> None:
        """Rules 8 to 11."""
        gaps = {car: car.box.gap(region.box) for car in self.cars}
        car = min(
            (car for car, gap in gaps.items() if gap <= self._settings.max_distance),
            key=lambda car: (car in self.assigned, gaps[car], _distance(car, region)),
            default=None,
        )
        if car is not None and self._assign_combined(region, car):
            return
        if car is None or car in self.assigned:
            self._create(region).trust(region.peak)
        elif car.is_filled_by(region):
            self._assign(car, region)

    def _assign_combined(self, region: Region, car: Car) -> bool:
        """Rules 9 and 10; False where no other region makes up the car together with this one."""
        nearby = (
            candidate
            for candidate in self._unused
            if candidate is not region and car.box.gap(candidate.box) <= self._settings.max_distance
        )
        nearest = min(nearby, key=lambda candidate: _distance(car, candidate), default=None)
        partner = self.assigned.get(car, nearest)
        if partner is None or not car.is_as_wide_as(combined := combine(region, partner)):
            return False
        if combined.box.width < self._settings.max_combined:
            self._assign(car, combined, region, partner)
            return True
        self._forget(car)
        closer, farther = sorted((region, partner), key=lambda part: _distance(car, part))
        self._create(closer, car.id).vouch()
        self._create(farther).vouch()
        return True

    def _create(self, region: Region, number: int | None = None) -> Car:
        car = Car(self._settings, number)
        self._created.append(car)
        self._assign(car, region)
        return car

    def _forget(self, *cars: Car) -> None:
        for car in cars:
            self.cars.remove(car)
            self.assigned.pop(car, None)

    def _assign(self, car: Car, region: Region, *parts: Region) -> None:
        """Assign a region to a car; it is made of these parts, if any, which are then used."""
        self.assigned[car] = region
        self._unused = [item for item in self._unused if item not in (parts or (region,))]

    def _absorb(self, car: Car) -> bool:
        """Rule 12: a shown car gives way to the one that is now where it was."""
        covering = [item for item in self.assigned if item.box.contains(car.centroid)]
        if car.id is None or not covering:
            return False
        successor = min(covering, key=lambda item: math.dist(item.centroid, car.centroid))
        successor.vouch()
        if successor.id is None:
            successor.id = car.id
        self.cars.remove(car)
        return True

    def _search(self, car: Car, image: Image) -> None:
        """Rule 13: search the frame for the image of a shown car."""
        match = None if car.id is None else car.find_in(image)
        if match is None:
            car.miss()
        else:
            car.see(match, image, by_match=True)

    def _track(self, car: Car) -> Track:
        """Return what is shown of a car; it gets its id when it is first shown."""
        car.id = next(self._ids) if car.id is None else car.id
        state: State = "predicted" if car.matches else "detected"
        return Track(car.id, car.box, car.score, state, car.votes.winner)


def large_enough(
    detections: Boxes, frame_width: int, frame_height: int, settings: RulesTrackerSettings
) -> list[Region]:
    """Return the regions, clipped to the frame, that are large enough.

    Rule 1. The part of a region outside the frame does not count.
    """
    minimum = max(1, settings.min_region)
    boxes = [detection.box.rounded.clipped(frame_width, frame_height) for detection in detections]
    centers = (detections.sides[:, :2] + detections.sides[:, 2:]) / 2
    centroids = map(tuple, detections.data.get("centroid", centers).tolist())
    strengths = detections.data.get("strength", detections.scores).tolist()
    scores, classes = detections.scores.tolist(), detections.likely_classes
    regions = map(Region, boxes, centroids, strengths, scores, classes)
    return [r for r in regions if r.box.width >= minimum and r.box.height >= minimum]


def _distance(car: Car, region: Region) -> float:
    return math.dist(car.centroid, region.centroid)


def _any_overlap(regions: Iterable[Region], pixels: int) -> bool:
    """Return whether two regions overlap by more than `pixels`, across and down (rule 4)."""
    common = (a.box.intersection(b.box) for a, b in combinations(regions, 2))
    return any(box.width > pixels and box.height > pixels for box in common)


def make_rules_tracker(settings: RulesTrackerSettings, _width: int, height: int) -> RulesTracker:
    """Return a tracker for frames of `height` rows."""
    return RulesTracker(scale_lengths(settings, height / REFERENCE_HEIGHT))
