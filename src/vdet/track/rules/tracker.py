"""The rules tracker: which cars there are, frame after frame.

Where the description of the original system can be read in two ways, this is the choice
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

from vdet.boxes import Boxes, Image
from vdet.config.tracker import RulesTrackerSettings
from vdet.media import Picture
from vdet.track.rules.association import Association, Car, Region
from vdet.track.track import State, Track


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
            raise ValueError("the rules tracker needs the frame; pass its image")
        regions = large_enough(detections, picture.width, picture.height, self._settings)
        association = Association(self._cars, regions, picture.image, self._settings)
        self._cars, placed = association.cars, association.places
        for car, place in placed.items():
            car.see(place, picture.image)
        for car in [car for car in self._cars if car not in placed]:
            if not self._absorb(car, placed):
                self._search(car, picture.image)
        self._cars = [car for car in self._cars if not car.is_over]
        shown = [car for car in self._cars if car.is_shown]
        return sorted((self._track(car) for car in shown), key=lambda track: track.id)

    def _absorb(self, car: Car, others: Iterable[Car]) -> bool:
        """Rule 12: a shown car gives way to the one that is now where it was."""
        there = [other for other in others if other.box.contains(car.centroid)]
        if car.id is None or not there:
            return False
        successor = min(there, key=lambda other: math.dist(other.centroid, car.centroid))
        successor.vouch()
        if successor.id is None:
            successor.id = car.id
        self._cars.remove(car)
        return True

    def _search(self, car: Car, image: Image) -> None:
        """Rule 13: the image of a shown car is searched in the frame."""
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
    """Return the regions, clipped to the frame, that are not narrower or lower than allowed.

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
