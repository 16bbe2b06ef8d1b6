"""The motion tracker: which vehicles there are, frame after frame."""

from collections.abc import Iterable, Sequence
from itertools import count, product

import numpy as np

from vdet.config.schema import MotionTrackerSettings
from vdet.detect.detections import Detections
from vdet.geometry import Box, Float64Array, iou_matrix, visible
from vdet.media.images import Image
from vdet.track.motion.identity import take_over_ids, without_duplicates
from vdet.track.motion.overlapping import (
    are_hidden,
    around,
    shows_both,
    stretched,
)
from vdet.track.motion.pairing import pair
from vdet.track.motion.vehicle import Sighting, Vehicle
from vdet.track.track import Track

Found = dict[int, Sighting]


class MotionTracker:
    """The vehicles of one video; make a new one for every video, ids start at 1 in each.

    Parameters
    ----------
    settings
        Its lengths are shares of the vehicles' own size or of the frame.
    width, height
        Size of the frames, pixels.
    """

    def __init__(self, settings: MotionTrackerSettings, width: int, height: int) -> None:
        self._settings = settings
        self._size = width, height
        self._vehicles: list[Vehicle] = []
        self._ids = count(1)

    def update(
        self,
        detections: Detections,
        time: float,  # noqa: ARG002
        image: Image | None = None,  # noqa: ARG002 - boxes are enough
    ) -> list[Track]:
        """Follow the vehicles into the next frame; as `VideoTracker.update`."""
        sightings = self._sightings(detections)
        for vehicle in self._vehicles:
            vehicle.predict(self._settings)
        self._vehicles = self._staying()
        expected = self._boxes()
        pairs = self._pair(expected, sightings)
        found = {row: sightings[number] for row, number in pairs.items()}
        found |= self._seen_as_one(expected, found)
        for row, vehicle in enumerate(self._vehicles):
            if row in found:
                vehicle.see(found[row], self._size, self._settings)
            else:
                vehicle.miss(self._settings)
        left = [s for number, s in enumerate(sightings) if number not in pairs.values()]
        new = [Vehicle.new(s, self._settings) for s in left if self._is_telling(s)]
        self._vehicles = self._staying() + new
        self._vehicles = take_over_ids(self._vehicles)
        self._vehicles = without_duplicates(self._vehicles, self._size, self._settings)
        return self._tracks()

    def _sightings(self, detections: Detections) -> list[Sighting]:
        clipped = [box.clipped(*self._size) for box in detections.rounded]
        return [
            Sighting(np.array([box.x, box.y, box.width, box.height], np.float64), float(score))
            for box, score in zip(clipped, detections.scores, strict=True)
            if box.area
        ]

    def _boxes(self) -> Float64Array:
        """Return the visible parts of all vehicles, `(n, 4)`."""
        boxes = [vehicle.state.box for vehicle in self._vehicles]
        return visible(np.reshape(boxes, (-1, 4)), self._size)

    def _staying(self) -> list[Vehicle]:
        """Return the vehicles that are neither over nor out of the frame."""
        return [
            vehicle
            for vehicle, (_, _, width, height) in zip(self._vehicles, self._boxes(), strict=True)
            if min(width, height) >= 1 and not vehicle.is_over(self._settings)
        ]

    def _pair(self, expected: Float64Array, sightings: Sequence[Sighting]) -> dict[int, int]:
        """Pair rows of vehicles with numbers of sightings; those present choose first."""
        present: list[int] = []
        lost: list[int] = []
        new: list[int] = []
        for row, vehicle in enumerate(self._vehicles):
            if vehicle.is_present(self._settings):
                present.append(row)
            else:
                (lost if vehicle.confirmed else new).append(row)
        boxes = np.reshape([sighting.box for sighting in sightings], (-1, 4))
        scores = iou_matrix(expected, boxes)
        scores[scores < self._settings.overlap] = 0
        faint = [number for number, s in enumerate(sightings) if not self._is_telling(s)]
        scores[np.ix_(lost, faint)] = 0  # a stray glimmer would lead them away
        return pair(scores, [present, lost, new])

    def _is_telling(self, sighting: Sighting) -> bool:
        """Tell whether such a region, lasting, would make a vehicle."""
        return sighting.clearness > self._settings.leak

    def _hidden(self, boxes: Float64Array) -> list[bool]:
        present = [vehicle.is_present(self._settings) for vehicle in self._vehicles]
        return are_hidden(boxes, np.array(present, bool), self._settings.hidden)

    def _seen_as_one(self, expected: Float64Array, found: Found) -> Found:
        """Share a region among two vehicles that it shows as one."""
        shared: Found = {}
        hidden = self._hidden(expected)
        missed = [row for row in range(len(expected)) if row not in found and not hidden[row]]
        for row, other in product(self._confirmed(found), self._confirmed(missed)):
            region, both = found[row], expected[[row, other]]
            if other in shared or not shows_both(region.box, both, self._settings.part):
                continue
            for each in (row, other):
                box = stretched(expected[each], around(both), region.box)
                shared[each] = Sighting(box, region.clearness)
        return shared

    def _confirmed(self, rows: Iterable[int]) -> list[int]:
        return [row for row in rows if self._vehicles[row].confirmed]

    def _tracks(self) -> list[Track]:
        boxes = self._boxes()
        tracks = []
        for vehicle, box, hidden in zip(self._vehicles, boxes, self._hidden(boxes), strict=True):
            vehicle.hidden_misses += hidden and vehicle.misses > 0
            wide_enough = box[2] >= self._settings.smallest * self._size[0]
            gone = hidden and vehicle.misses
            if vehicle.is_present(self._settings) and wide_enough and not gone:
                vehicle.id = next(self._ids) if vehicle.id is None else vehicle.id
                tracks.append(
                    Track(vehicle.id, _rounded(box), score=1.0, predicted=vehicle.misses > 0)
                )
        return sorted(tracks, key=lambda track: track.id)


def _rounded(box: Float64Array) -> Box:
    left, top = np.floor(box[:2] + 0.5).astype(int).tolist()
    right, bottom = np.floor(box[:2] + box[2:] + 0.5).astype(int).tolist()
    return Box(left, top, right - left, bottom - top)
