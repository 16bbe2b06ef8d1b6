"""The rules tracker: which cars there are, frame after frame.

Source: seed section 3, "Video pipeline". Where it can be read in two ways, this is the choice
(`association` has those for the regions):

* A car counts as shown before if it ever was, not only in the frame before.
* "In a row" is up to this frame: a car that is missed once is counted from the start again.
* The car that absorbs another one is detected by region in this frame, and the other's average
  centroid lies in its average rectangle. It keeps its id, or takes the other's if it has none yet.
* The searched image is the latest one, around the latest rectangle.
* A car found by match for the last time allowed is deleted in that frame, and not shown in it.
"""

import math
from collections.abc import Iterable
from itertools import count

from vdet.boxes import Boxes
from vdet.config.schema import RulesTrackerSettings
from vdet.media import Picture
from vdet.media.images import Image
from vdet.track.rules.association import Association
from vdet.track.rules.car import Car, Region
from vdet.track.track import Track


class RulesTracker:
    """The cars of one video; make a new one for every video, ids start at 1 in each.

    Parameters
    ----------
    settings
        Lengths already scaled to the frame.
    """

    def __init__(self, settings: RulesTrackerSettings) -> None:
        self._settings = settings
        self._cars: list[Car] = []
        self._ids = count(1)

    def update(
        self,
        detections: Boxes,
        time: float,  # noqa: ARG002 - the rules count frames
        picture: Picture | None = None,
    ) -> list[Track]:
        """Follow the cars into the next frame as `VideoTracker.update`; `picture` is needed."""
        if picture is None:
            raise ValueError("the rules tracker needs the frame; give its image")
        image = picture.image
        regions = large_enough(detections, picture.width, picture.height, self._settings)
        association = Association(self._cars, regions, image, self._settings)
        self._cars = association.cars
        placed = association.places
        for car, place in placed.items():
            car.see(place, image)
        for car in [car for car in self._cars if car not in placed]:
            if not self._absorb(car, placed):
                self._search(car, image)
        self._cars = [car for car in self._cars if not self._is_over(car)]
        return self._tracks()

    def _absorb(self, car: Car, others: Iterable[Car]) -> bool:
        """Rule 12: a shown car gives way to the one that is now where it was."""
        there = [other for other in others if other.box.contains(car.centroid)]
        if car.id is None or not there:
            return False
        successor = min(there, key=lambda other: math.dist(other.centroid, car.centroid))
        successor.count_at_least(self._settings.detections_needed)
        if successor.id is None:
            successor.id = car.id
        self._cars.remove(car)
        return True

    def _search(self, car: Car, image: Image) -> None:
        """Rule 13: the image of a shown car is searched in the frame."""
        box = None if car.id is None else car.find_in(image, self._settings)
        if box is None:
            car.miss()
        else:
            car.see_match(box, image)

    def _is_over(self, car: Car) -> bool:
        """Rules 15, 16 and 17: the reasons to delete a car."""
        young_and_missed = not car.detected and car.count < self._settings.young
        only_matched = car.matches >= self._settings.max_matches
        gone = car.misses >= self._settings.max_misses
        return young_and_missed or only_matched or gone

    def _tracks(self) -> list[Track]:
        """Rule 14; a car gets its id when it is first shown."""
        tracks = []
        for car in self._cars:
            if car.is_shown:
                car.id = next(self._ids) if car.id is None else car.id
                tracks.append(Track(car.id, car.box, car.score, car.matches > 0, car.class_name))
        return sorted(tracks, key=lambda track: track.id)


def large_enough(
    detections: Boxes, frame_width: int, frame_height: int, settings: RulesTrackerSettings
) -> list[Region]:
    """Return the regions, clipped to the frame, that are not narrower or lower than allowed.

    Rule 1. The part of a region outside the frame does not count.
    """
    least = max(1, settings.min_region)
    centroids = detections.data.get("centroid", detections.centers).tolist()
    strengths = detections.data.get("strength", detections.scores).tolist()
    regions = [
        Region(
            each.box.rounded.clipped(frame_width, frame_height),
            (x, y),
            strength,
            each.score,
            each.class_name,
        )
        for each, (x, y), strength in zip(detections, centroids, strengths, strict=True)
    ]
    return [r for r in regions if r.box.width >= least and r.box.height >= least]
