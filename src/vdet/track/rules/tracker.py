"""The rules tracker, which follows cars from frame to frame by rules 1 to 17.

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
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import combinations, count

from vdet.boxes import Boxes, Image
from vdet.config.kinds import RulesTrackerSettings
from vdet.config.section import REFERENCE_HEIGHT, scale_lengths
from vdet.errors import ArgumentError
from vdet.media import Picture
from vdet.track.rules.car import Car, Region, combine
from vdet.track.track import State, Track


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
