"""The rules tracker, which follows cars from frame to frame by rules 1 to 17.

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
from vdet.config.section import REFERENCE_HEIGHT, scale_lengths
from vdet.config.tracker import RulesTrackerSettings
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
        The cars known so far, each detected at least once.
    places
        The cars that have a place in the latest frame; its `box` and `centroid` are the detection.
    """

    def __init__(self, settings: RulesTrackerSettings) -> None:
        self._settings = settings
        self.cars: list[Car] = []
        self.places: dict[Car, Region] = {}
        self._created: list[Car] = []
        self._unused: list[Region] = []
        self._ids = count(1)

    def update(
        self,
        detections: Boxes,
        time: float,  # noqa: ARG002 - the rules count frames
        picture: Picture | None = None,
    ) -> list[Track]:
        """Follow the cars into the next frame, as `VideoTracker.update`; `picture` is required."""
        if picture is None:
            raise ArgumentError("image: the rules tracker needs the frame; pass it")
        regions = large_enough(detections, picture.width, picture.height, self._settings)
        self.associate(regions, picture.image)
        for car, place in self.places.items():
            car.see(place, picture.image)
        for car in [car for car in self.cars if car not in self.places]:
            if not self._absorb(car):
                self._search(car, picture.image)
        self.cars = [car for car in self.cars if not car.is_over]
        shown = [car for car in self.cars if car.is_shown]
        return sorted((self._track(car) for car in shown), key=lambda track: track.id)

    def associate(self, regions: Sequence[Region], image: Image) -> None:
        """Assign the regions of the next frame to cars, old and new ones (rules 2 to 11).

        The regions lie inside the frame `image`, BGR uint8 `(H, W, 3)`, and are large enough. Cars
        get places, ids and counts, but no detections yet.
        """
        self.places, self._created, self._unused = {}, [], list(regions)
        for region in [region for region in regions if not self._place_inside(region, image)]:
            if region in self._unused:
                self._place_near(region)
        self.cars += self._created

    def _place_inside(self, region: Region, image: Image) -> bool:
        """Rules 2 to 7; False where no car is inside the region."""
        inside = [
            car for car in self.cars if car not in self.places and region.box.contains(car.centroid)
        ]
        found = {car: car.find_in(image) for car in inside} if len(inside) > 1 else {}
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
            (car for car, gap in gaps.items() if gap <= self._settings.max_distance),
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
        others = (other for other in self._unused if other is not region)
        near = [other for other in others if car.box.gap(other.box) <= self._settings.max_distance]
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

    def _absorb(self, car: Car) -> bool:
        """Rule 12: a shown car gives way to the one that is now where it was."""
        there = [other for other in self.places if other.box.contains(car.centroid)]
        if car.id is None or not there:
            return False
        successor = min(there, key=lambda other: math.dist(other.centroid, car.centroid))
        successor.vouch()
        if successor.id is None:
            successor.id = car.id
        self.cars.remove(car)
        return True

    def _search(self, car: Car, image: Image) -> None:
        """Rule 13: search the frame for the image of a shown car."""
        found = None if car.id is None else car.find_in(image)
        if found is None:
            car.miss()
        else:
            car.see(found, image, by_match=True)

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
    common = (one.box.intersection(other.box) for one, other in combinations(regions, 2))
    return any(box.width > pixels and box.height > pixels for box in common)


def make_rules_tracker(settings: RulesTrackerSettings, _width: int, height: int) -> RulesTracker:
    """Return a tracker for frames of `height` rows."""
    return RulesTracker(scale_lengths(settings, height / REFERENCE_HEIGHT))
