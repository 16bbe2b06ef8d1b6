"""The motion tracker, frame by frame."""

from collections.abc import Sequence
from itertools import count

import numpy as np

from vdet.boxes import BoolArray, Box, Boxes, Float64Array, are_nested, visible
from vdet.config.schema import MotionTrackerSettings
from vdet.media import Picture
from vdet.track.motion.appearance import appearances, differences
from vdet.track.motion.association import (
    are_hidden,
    are_parts,
    buffered_iou,
    pair,
    take_over_ids,
    without_duplicates,
)
from vdet.track.motion.history import Place
from vdet.track.motion.vehicle import Look, Observation, Vehicle
from vdet.track.track import Track

FIRST_STEP = 0.04
"""Seconds that the first frame counts for."""

_STAYS = 0.75
"""Share of the least score from which on a vehicle that was shown before is shown again."""

_OVERLAP = 0.3
"""Least intersection over union of a detection with the expected box of its vehicle."""

_UNSURE = 0.2
"""Share by which a vehicle that scores 0 has less claim to a detection than one that scores 1.

A shadow that is taken for a vehicle does not keep the detections of those that drive over it.
"""


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
        self._gone: list[Vehicle] = []  # not followed any more, but shown at earlier times

    def update(self, detections: Boxes, time: float, picture: Picture | None = None) -> list[Track]:
        """Follow the vehicles into the next frame and show them; as `VideoTracker.update`."""
        self.observe(detections, time, picture)
        return self.at(time)

    def observe(self, detections: Boxes, time: float, picture: Picture | None = None) -> None:
        """Follow the vehicles into the next frame; as `TimedTracker.observe`.

        The part of a detection outside the frame does not count.
        """
        observations = self._observations(detections, picture)
        seconds = FIRST_STEP if self._time is None else time - self._time
        self._time, look = time, Look(time, seconds, self._size)
        self._predict(seconds)
        pairs = self._pair(observations)
        for row, vehicle in enumerate(self._vehicles):
            if row in pairs:
                vehicle.see(observations[pairs[row]], look)
            else:
                vehicle.miss(look)
        left = [o for number, o in enumerate(observations) if number not in pairs.values()]
        self._keep(self._staying())
        new = [Vehicle(o, look, self._settings) for o in left if self._adds_evidence(o)]
        self._vehicles = without_duplicates(take_over_ids(self._vehicles + new), self._size)
        for vehicle, hidden in zip(self._vehicles, self._hidden(self._boxes()), strict=True):
            vehicle.hidden += seconds * (bool(hidden) and vehicle.unseen > 0)
        self._forget(time - 2 * self._settings.look_ahead)

    def at(self, time: float) -> list[Track]:
        """Return the vehicles shown at a time; as `TimedTracker.at`."""
        known = [*self._gone, *(vehicle for vehicle in self._vehicles if vehicle.confirmed)]
        found = [(v, place) for v in known if (place := self._place(v, time)) is not None]
        if not found:
            return []
        boxes = visible(np.reshape([place.box for _, place in found], (-1, 4)), self._size)
        keep = [row for row, box in enumerate(boxes) if _least_side(box) >= 1]
        found, boxes = [found[row] for row in keep], boxes[keep]
        scores = [vehicle.history.scores(time) for vehicle, _ in found]
        is_here = np.array([place.state != "lost" for _, place in found], bool)
        hidden = are_hidden(boxes, is_here)
        shown = [
            row
            for row, (_, place) in enumerate(found)
            if self._is_clear(found[row][0], boxes[row], scores[row][0])
            and not (hidden[row] and (place.bridges or place.state == "lost"))
        ]
        nested = are_nested(boxes[shown], [scores[row][1] for row in shown])
        tracks = [
            self._track(*found[row], boxes[row], scores[row][1])
            for row, is_nested in zip(shown, nested, strict=True)
            if not is_nested
        ]
        return sorted(tracks, key=lambda track: track.id)

    def _place(self, vehicle: Vehicle, time: float) -> Place | None:
        """Return where a vehicle is at a time, if it is to be shown then."""
        assert self._time is not None
        place = vehicle.history.at(time, self._settings.look_ahead)
        if place is not None or time < vehicle.history.last_seen or vehicle in self._gone:
            return place
        if not vehicle.is_present:
            return None
        state = vehicle.state.predicted(time - self._time, 0.0)
        return Place(state.mean[:, 0], "lost" if vehicle.unseen else "between")

    def _predict(self, seconds: float) -> None:
        """Move all vehicles on; forget those not seen for too long, and those out of the frame."""
        longest = self._settings.remembered + self._settings.remembered_hidden
        self._keep([v for v in self._vehicles if v.unseen + seconds <= longest])
        for vehicle in self._vehicles:
            vehicle.predict(seconds)
        self._keep(self._staying())

    def _keep(self, vehicles: list[Vehicle]) -> None:
        """Follow only these vehicles; those that are confirmed can be shown at earlier times."""
        self._gone += [v for v in self._vehicles if v.confirmed and v not in vehicles]
        self._vehicles = vehicles

    def _forget(self, before: float) -> None:
        self._gone = [each for each in self._gone if each.history.last_seen >= before]
        for vehicle in self._vehicles:
            vehicle.history.forget(before)

    def _observations(self, detections: Boxes, picture: Picture | None) -> list[Observation]:
        boxes = visible(detections.sides, self._size)
        seen = appearances(picture, boxes)
        return [
            Observation(box, each.score, each.class_name, appearance)
            for box, each, appearance in zip(boxes, detections, seen, strict=True)
            if _least_side(box) >= 1
        ]

    def _boxes(self) -> Float64Array:
        """Return the visible parts of all vehicles, `(n, 4)`."""
        boxes = [vehicle.state.box for vehicle in self._vehicles]
        return visible(np.array(boxes).reshape(-1, 4), self._size)

    def _staying(self) -> list[Vehicle]:
        """Return the vehicles that are neither over nor out of the frame."""
        each = zip(self._vehicles, self._boxes(), strict=True)
        return [vehicle for vehicle, box in each if _least_side(box) >= 1 and not vehicle.is_over]

    def _pair(self, observations: Sequence[Observation]) -> dict[int, int]:
        """Pair rows of vehicles with numbers of observations; present vehicles choose first.

        The values are squared: one good pair is worth more than two poor ones. Lost vehicles are
        found again by `take_over_ids`.
        """
        if not (self._vehicles and observations):
            return {}
        present = [row for row, each in enumerate(self._vehicles) if each.is_present]
        new = [row for row, each in enumerate(self._vehicles) if not each.confirmed]
        expected = self._boxes()
        boxes = np.reshape([observation.box for observation in observations], (-1, 4))
        buffers = np.reshape([v.state.deviation for v in self._vehicles], (-1, 2))
        values = buffered_iou(expected, buffers, boxes)
        values[values < _OVERLAP] = 0
        values *= np.exp(-(self._differences(observations) ** 2))
        scores = np.array([[vehicle.detection_scores.value] for vehicle in self._vehicles])
        values *= 1 - _UNSURE * (1 - scores)
        parts = are_parts(boxes, np.array([observation.score for observation in observations]))
        values[np.ix_(self._hidden(expected), parts)] = 0  # parts of the vehicle that hides it
        return pair(values**2, [present, new])

    def _differences(self, observations: Sequence[Observation]) -> Float64Array:
        """Return how much the appearances of vehicles and observations differ, `(n, m)`."""
        known = np.reshape([vehicle.appearance for vehicle in self._vehicles], (-1, 1, 2, 3))
        return differences(known, np.reshape([o.appearance for o in observations], (-1, 2, 3)))

    def _adds_evidence(self, observation: Observation) -> bool:
        """Return whether such a detection, repeated in each frame, would make a vehicle."""
        return observation.score > self._settings.leak

    def _hidden(self, boxes: Float64Array) -> BoolArray:
        return are_hidden(boxes, np.array([each.is_present for each in self._vehicles], bool))

    def _is_clear(self, vehicle: Vehicle, box: Float64Array, score: float) -> bool:
        """Return whether a vehicle is wide enough and likely enough to be shown.

        One that was shown before may be a little less likely.
        """
        is_wide = bool(box[2] - box[0] >= self._settings.smallest * self._size[0])
        least = self._settings.least_score * (1.0 if vehicle.id is None else _STAYS)
        return is_wide and score >= least

    def _track(self, vehicle: Vehicle, place: Place, box: Float64Array, score: float) -> Track:
        vehicle.id = next(self._ids) if vehicle.id is None else vehicle.id
        return Track(
            vehicle.id,
            Box(*box.tolist()),
            score,
            place.state,
            class_name=vehicle.classes.best,
            whole_foot=Box(*place.box.tolist()).foot,
        )


def _least_side(box: Float64Array) -> float:
    return float(min(box[2:] - box[:2]))
