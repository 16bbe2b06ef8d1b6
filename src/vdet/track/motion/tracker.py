"""The motion tracker, frame by frame."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import count

import numpy as np

from vdet.boxes import BoolArray, Box, Boxes, Float64Array, are_nested, visible
from vdet.config.schema import MotionTrackerSettings
from vdet.media import Picture
from vdet.track.motion.association import (
    are_hidden,
    are_parts,
    buffered_iou,
    pair,
    take_over_ids,
    without_duplicates,
)
from vdet.track.motion.vehicle import Observation, Vehicle
from vdet.track.track import Track

FIRST_STEP = 0.04
"""Seconds that the first frame counts for."""

_OVERLAP = 0.3
"""Least intersection over union of a detection with the expected box of its vehicle."""

SHORTEST_STEP = 0.001
"""Least seconds between frames, also where two have the same time or the clock goes back."""


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
        self._time: float | None = None
        self._unsearched = 0.0  # seconds since the latest frame that was searched

    def update(self, detections: Boxes, time: float, picture: Picture | None = None) -> list[Track]:  # noqa: ARG002
        """Follow the vehicles into the next frame; as `VideoTracker.update`.

        The part of a detection outside the frame does not count.
        """
        observations = self._observations(detections)
        seconds, self._unsearched = self._unsearched + self._move_to(time), 0.0
        pairs = self._pair(observations)
        for row, vehicle in enumerate(self._vehicles):
            if row in pairs:
                vehicle.see(observations[pairs[row]], seconds, self._size)
            else:
                vehicle.miss(seconds)
        left = [o for number, o in enumerate(observations) if number not in pairs.values()]
        new = [Vehicle(o, seconds, self._settings) for o in left if self._adds_evidence(o)]
        self._vehicles = take_over_ids(self._staying() + new)
        self._vehicles = without_duplicates(self._vehicles, self._size)
        return self._tracks(seconds)

    def carry(self, time: float, picture: Picture | None = None) -> list[Track]:  # noqa: ARG002
        """Move the vehicles on into a frame that was not searched; as `CarryingTracker.carry`.

        Nothing is missed there: the evidence and the times without a detection stay as they are,
        and the next `update` counts the seconds since the one before.
        """
        self._unsearched += self._move_to(time)
        return [replace(track, predicted=True) for track in self._tracks(0.0)]

    def _move_to(self, time: float) -> float:
        """Move all vehicles on to this time, and return the seconds since the frame before.

        Vehicles that were not seen for too long and those out of the frame are forgotten.
        """
        seconds = FIRST_STEP if self._time is None else max(time - self._time, SHORTEST_STEP)
        self._time = time
        longest = self._settings.remembered + self._settings.remembered_hidden
        self._vehicles = [v for v in self._vehicles if v.unseen + seconds <= longest]
        for vehicle in self._vehicles:
            vehicle.predict(seconds)
        self._vehicles = self._staying()
        return seconds

    def _observations(self, detections: Boxes) -> list[Observation]:
        boxes = visible(detections.sides, self._size)
        return [
            Observation(box, each.score, each.class_name)
            for box, each in zip(boxes, detections, strict=True)
            if _least_side(box) >= 1
        ]

    def _boxes(self) -> Float64Array:
        """Return the visible parts of all vehicles, `(n, 4)`."""
        boxes = [vehicle.state.box for vehicle in self._vehicles]
        return visible(np.reshape(boxes, (-1, 4)), self._size)

    def _staying(self) -> list[Vehicle]:
        """Return the vehicles that are neither over nor out of the frame."""
        each = zip(self._vehicles, self._boxes(), strict=True)
        return [vehicle for vehicle, box in each if _least_side(box) >= 1 and not vehicle.is_over]

    def _pair(self, observations: Sequence[Observation]) -> dict[int, int]:
        """Pair rows of vehicles with numbers of observations; present vehicles choose first."""
        present: list[int] = []
        lost: list[int] = []
        new: list[int] = []
        for row, vehicle in enumerate(self._vehicles):
            group = present if vehicle.is_present else lost if vehicle.confirmed else new
            group.append(row)
        expected = self._boxes()
        boxes = np.reshape([observation.box for observation in observations], (-1, 4))
        buffers = np.reshape([v.state.deviation for v in self._vehicles], (-1, 2))
        values = buffered_iou(expected, buffers, boxes)
        values[values < _OVERLAP] = 0
        weak = [number for number, o in enumerate(observations) if not self._adds_evidence(o)]
        values[np.ix_(lost, weak)] = 0  # weak detections must not re-identify lost tracks
        parts = are_parts(boxes, np.array([observation.score for observation in observations]))
        values[np.ix_(self._hidden(expected), parts)] = 0  # parts of the vehicle that hides it
        return pair(values, [present, lost, new])

    def _adds_evidence(self, observation: Observation) -> bool:
        """Tell whether such a detection, repeated in each frame, would make a vehicle."""
        return observation.score > self._settings.leak

    def _hidden(self, boxes: Float64Array) -> BoolArray:
        return are_hidden(boxes, np.array([each.is_present for each in self._vehicles], bool))

    def _tracks(self, seconds: float) -> list[Track]:
        """Return the vehicles that are shown, by id; `seconds` since the latest searched frame."""
        boxes = self._boxes()
        shown: list[int] = []
        for row, hidden in enumerate(self._hidden(boxes)):
            vehicle = self._vehicles[row]
            is_gone = bool(hidden) and vehicle.unseen > 0
            vehicle.hidden += seconds * is_gone
            if self._is_clear(vehicle, boxes[row]) and not is_gone:
                shown.append(row)
        nested = are_nested(boxes[shown], [self._vehicles[row].scores.value for row in shown])
        tracks = [
            self._track(self._vehicles[row], boxes[row])
            for row, is_nested in zip(shown, nested, strict=True)
            if not is_nested
        ]
        return sorted(tracks, key=lambda track: track.id)

    def _is_clear(self, vehicle: Vehicle, box: Float64Array) -> bool:
        """Tell whether it is present, wide enough and likely enough to be shown."""
        is_wide = bool(box[2] - box[0] >= self._settings.smallest * self._size[0])
        is_likely = vehicle.detection_scores.value >= self._settings.least_score
        return vehicle.is_present and is_wide and is_likely

    def _track(self, vehicle: Vehicle, box: Float64Array) -> Track:
        vehicle.id = next(self._ids) if vehicle.id is None else vehicle.id
        return Track(
            vehicle.id,
            Box(*box.tolist()),
            vehicle.scores.value,
            predicted=vehicle.unseen > 0,
            class_name=vehicle.classes.best,
            whole_foot=Box(*vehicle.state.box.tolist()).foot,
        )


def _least_side(box: Float64Array) -> float:
    return float(min(box[2:] - box[:2]))
