"""Which region of a frame belongs to which car, and which regions become cars (rules 2 to 11).

Source: seed section 3, "Video pipeline". Where it can be read in two ways, this is the choice:

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
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import combinations

from vdet.boxes import Box
from vdet.config.schema import RulesTrackerSettings
from vdet.media.images import Image
from vdet.track.rules.car import Car, Region


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
        self.places: dict[Car, Region] = {}
        self._known = list(cars)
        self._created: list[Car] = []
        self._unused = list(regions)
        self._image = image
        self._settings = settings
        self._run()

    @property
    def cars(self) -> list[Car]:
        """The cars after this frame: those known that live on, then those created."""
        return self._known + self._created

    def _run(self) -> None:
        without_car = []
        for region in list(self._unused):
            if inside := self._cars_in(region):
                self._place_inside(region, inside)
            else:
                without_car.append(region)
        for region in without_car:
            if region in self._unused:
                self._place_near(region)

    def _cars_in(self, region: Region) -> list[Car]:
        """Rule 2."""
        free = [car for car in self._known if car not in self.places]
        return [car for car in free if region.box.contains(car.centroid)]

    def _place_inside(self, region: Region, inside: list[Car]) -> None:
        matches = self._confirm(inside) if len(inside) > 1 else {}
        if len(matches) > 1:
            self._merge_or_separate(region, matches)
        else:
            self._place_alone(region, _nearest(region, matches or inside))

    def _confirm(self, cars: Iterable[Car]) -> dict[Car, Box]:
        """Rule 3: the cars whose latest image is found, and where."""
        found = {car: car.find_in(self._image, self._settings) for car in cars}
        return {car: box for car, box in found.items() if box is not None}

    def _merge_or_separate(self, region: Region, matches: dict[Car, Box]) -> None:
        """Rules 4 and 5."""
        if any_overlap(list(matches.values()), self._settings.merge_overlap):
            ids = [car.id for car in matches if car.id is not None]
            self._forget(matches)
            self._create_vouched(region, min(ids, default=None))
        else:
            for car, box in matches.items():
                self.places[car] = replace(region, box=box, centroid=car.centroid_at(box))
        self._use([region])

    def _place_alone(self, region: Region, car: Car) -> None:
        """Rules 6 and 7."""
        if region.peak > self._settings.confident_peak:
            car.need(self._settings.confident_detections_needed)
        if is_good_size(region.box, car.box, self._settings):
            self._place(car, region)

    def _place_near(self, region: Region) -> None:
        car = self._near_car(region)
        if car is None:
            self._create(region)
        elif not self._place_combined(region, car):
            self._place_by_itself(region, car)

    def _near_car(self, region: Region) -> Car | None:
        near = [c for c in self._known if c.box.gap(region.box) <= self._settings.near]
        return min(
            near,
            key=lambda car: (
                car in self.places,
                car.box.gap(region.box),
                math.dist(car.centroid, region.centroid),
            ),
            default=None,
        )

    def _place_by_itself(self, region: Region, car: Car) -> None:
        """Rule 8."""
        if car in self.places:
            self._create(region)
        elif is_good_size(region.box, car.box, self._settings):
            self._place(car, region)

    def _place_combined(self, region: Region, car: Car) -> bool:
        """Rules 9 and 10; False where no other region makes up the car together with this one."""
        other = self._other_region(region, car)
        if other is None:
            return False
        combined = combine(region, other)
        if not is_about_size(combined.box, car.box, self._settings):
            return False
        if combined.box.width < self._settings.max_combined:
            self._place(car, combined, made_of=(region, other))
        else:
            self._split(car, region, other)
        return True

    def _other_region(self, region: Region, car: Car) -> Region | None:
        if car in self.places:
            return self.places[car]
        others = [
            other
            for other in self._unused
            if other is not region and car.box.gap(other.box) <= self._settings.near
        ]
        return min(others, key=lambda r: math.dist(r.centroid, car.centroid), default=None)

    def _split(self, car: Car, *regions: Region) -> None:
        """Rule 10: each of the two regions becomes a car, both shown at once."""
        self._forget([car])
        near, far = sorted(regions, key=lambda r: math.dist(r.centroid, car.centroid))
        self._create_vouched(near, car.id)
        self._create_vouched(far, None)
        self._use(regions)

    def _create(self, region: Region) -> None:
        """Rule 11."""
        car = self._new_car(region)
        if region.peak > self._settings.confident_peak:
            car.need(self._settings.confident_detections_needed)
        self._use([region])

    def _create_vouched(self, region: Region, id_kept: int | None) -> None:
        car = self._new_car(region)
        car.id = id_kept
        car.count_at_least(self._settings.detections_needed)

    def _new_car(self, region: Region) -> Car:
        car = Car(self._settings.detections_needed, self._settings.history)
        self._created.append(car)
        self.places[car] = region
        return car

    def _forget(self, cars: Iterable[Car]) -> None:
        for car in cars:
            self._known.remove(car)
            self.places.pop(car, None)

    def _place(self, car: Car, region: Region, made_of: Sequence[Region] = ()) -> None:
        self.places[car] = region
        self._use(made_of or [region])

    def _use(self, regions: Iterable[Region]) -> None:
        self._unused = [r for r in self._unused if all(r is not used for used in regions)]


def _nearest(region: Region, cars: Iterable[Car]) -> Car:
    return min(cars, key=lambda car: math.dist(car.centroid, region.centroid))


def is_good_size(region: Box, car: Box, settings: RulesTrackerSettings) -> bool:
    """Tell whether a region is wide enough to be all of the car (rules 7 and 8)."""
    return region.width > settings.wide or region.width > settings.good_fraction * car.width


def is_about_size(combined: Box, car: Box, settings: RulesTrackerSettings) -> bool:
    """Tell whether two regions, combined, are about as wide as the car (rules 9 and 10)."""
    return abs(combined.width - car.width) <= settings.combined_tolerance * car.width


def combine(first: Region, second: Region) -> Region:
    """Return the two as one: box around both, centroids weighted by box area, the higher peak."""
    one, two = first.box.area, second.box.area
    (x1, y1), (x2, y2) = first.centroid, second.centroid
    centroid = (x1 * one + x2 * two) / (one + two), (y1 * one + y2 * two) / (one + two)
    higher = max(first, second, key=lambda region: region.peak)
    return replace(higher, box=first.box.union(second.box), centroid=centroid)


def any_overlap(boxes: Sequence[Box], pixels: int) -> bool:
    """Tell whether two of the boxes overlap by more than `pixels`, across and down (rule 4)."""
    common = (a.intersection(b) for a, b in combinations(boxes, 2))
    return any(box.width > pixels and box.height > pixels for box in common)
