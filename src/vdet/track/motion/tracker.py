"""The motion tracker, frame by frame."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress, count

import numpy as np

from vdet.boxes import BoolArray, Box, Boxes, Float64Array, are_nested, clipped
from vdet.config.schema import MotionTrackerSettings
from vdet.media import Picture
from vdet.track.motion.association import (
    appearances,
    are_hidden,
    are_parts,
    buffered_iou,
    differences,
    pair,
    take_over_ids,
    without_duplicates,
)
from vdet.track.motion.vehicle import FrameStep, Observation, Position, TrackedVehicle, whole_box
from vdet.track.track import Track

FIRST_STEP = 0.04
"""Seconds that the first frame counts for."""

_STAYS = 0.75
"""Fraction of the minimum score at which a vehicle that was shown before is still shown."""

_CAR_HEIGHT = 0.8
"""Height of a car from behind as a fraction of its width."""

_OVERLAP = 0.3
"""Minimum intersection over union of a detection with the expected box of its vehicle."""

_UNSURE = 0.2
"""Fraction by which the value of a pair is lower for a vehicle with score 0 than with score 1.

A shadow tracked as a vehicle then does not take the detections of vehicles driving over it.
"""


class MotionTracker:
    """The vehicles of one video; make a new one for every video, ids start at 1 in each.

    Parameters
    ----------
    settings
        Its lengths are fractions of the vehicles' own size or of the frame.
    width, height
        Size of the frames, pixels.
    """

    def __init__(self, settings: MotionTrackerSettings, width: int, height: int) -> None:
        self._settings = settings
        self._size = width, height
        self._vehicles: list[TrackedVehicle] = []
        self._ids = count(1)
        self._time: float | None = None
        self._gone: list[TrackedVehicle] = []  # no longer tracked, but shown at earlier times

    def update(self, detections: Boxes, time: float, picture: Picture | None = None) -> list[Track]:
        """Track the vehicles into the next frame and show them; see `VideoTracker.update`."""
        self.observe(detections, time, picture)
        return self.at(time)

    def observe(self, detections: Boxes, time: float, picture: Picture | None = None) -> None:
        """Track the vehicles into the next frame; see `TimedTracker.observe`.

        The parts of detections outside the frame are ignored.
        """
        observations = self._observations(detections, picture)
        seconds = FIRST_STEP if self._time is None else time - self._time
        self._time, frame = time, FrameStep(time, seconds, self._size)
        longest = self._settings.keep_id_seconds + self._settings.keep_hidden_id_seconds
        self._keep([v for v in self._vehicles if v.unseen + seconds <= longest])
        for vehicle in self._vehicles:
            vehicle.predict(seconds)
        self._keep(self._staying())
        pairs = self._pair(observations)
        for row, vehicle in enumerate(self._vehicles):
            if row in pairs:
                vehicle.see(observations[pairs[row]], frame)
            else:
                vehicle.miss(frame)
        self._keep(self._staying())
        new = [
            TrackedVehicle(observation, frame, self._settings)
            for number, observation in enumerate(observations)
            if number not in pairs.values()
            # Detections with scores below the decay never add up to a vehicle.
            and observation.score > self._settings.decay
        ]
        vehicles = take_over_ids(self._vehicles + new)
        self._vehicles = without_duplicates(vehicles, self._boxes(vehicles))
        before = time - 2 * self._settings.look_ahead
        self._gone = [vehicle for vehicle in self._gone if vehicle.history.last_seen.time >= before]
        for vehicle, hidden in zip(self._vehicles, self._hidden(), strict=True):
            vehicle.hidden += seconds * (bool(hidden) and vehicle.unseen > 0)
            vehicle.history.forget(before)

    def at(self, time: float) -> list[Track]:
        """Return the vehicles shown at a time; see `TimedTracker.at`."""
        candidates = self._candidates(time)
        boxes = _boxes_of(candidates)
        hidden = are_hidden(boxes, [item.position.state != "predicted" for item in candidates])
        clear = [
            candidate
            for candidate, is_hidden in zip(candidates, hidden, strict=True)
            if self._is_clear(candidate) and not (is_hidden and candidate.is_guess)
        ]
        nested = are_nested(_boxes_of(clear), [candidate.score for candidate in clear])
        tracks = map(self._track, compress(clear, ~nested))
        return sorted(tracks, key=lambda track: track.id)

    def _candidates(self, time: float) -> "list[_Candidate]":
        """Return the vehicles in the frame at a time that may be shown."""
        vehicles = [*self._gone, *(vehicle for vehicle in self._vehicles if vehicle.confirmed)]
        positions = [(v, position) for v in vehicles if (position := self._position(v, time))]
        boxes = self._visible([position.mean for _, position in positions])
        in_frame = compress(zip(positions, boxes, strict=True), _are_large(boxes))
        return [
            _Candidate(vehicle, position, box, *vehicle.history.scores(time))
            for (vehicle, position), box in in_frame
        ]

    def _position(self, vehicle: TrackedVehicle, time: float) -> Position | None:
        """Return the position of a vehicle at a time; None if it is not shown then."""
        assert self._time is not None
        history = vehicle.history
        position = history.at(time, self._settings.look_ahead)
        if position is not None or time < history.last_seen.time or vehicle in self._gone:
            return position
        if not vehicle.is_present:
            return None
        mean = vehicle.state.moved(time - self._time)
        return Position(mean[:, 0], "predicted" if vehicle.unseen else "interpolated")

    def _keep(self, vehicles: list[TrackedVehicle]) -> None:
        """Track only these vehicles; the others, if confirmed, can be shown at earlier times."""
        self._gone += [v for v in self._vehicles if v.confirmed and v not in vehicles]
        self._vehicles = vehicles

    def _staying(self) -> list[TrackedVehicle]:
        """Return the vehicles that are neither ended nor outside the frame."""
        inside = compress(self._vehicles, _are_large(self._boxes(self._vehicles)))
        return [vehicle for vehicle in inside if not vehicle.is_over]

    def _observations(self, detections: Boxes, picture: Picture | None) -> list[Observation]:
        boxes = clipped(detections.sides, self._size)
        observations = map(
            Observation,
            boxes,
            detections.scores.tolist(),
            detections.likely_classes,
            appearances(picture, boxes),
        )
        return list(compress(observations, _are_large(boxes)))

    def _visible(self, means: Sequence[Float64Array]) -> Float64Array:
        """Return the part in the frame of each centre and size, `(n, 4)`; see `Position`."""
        return clipped(whole_box(np.reshape(means, (-1, 4))), self._size)

    def _boxes(self, vehicles: Sequence[TrackedVehicle]) -> Float64Array:
        """Return the visible parts of vehicles, `(n, 4)`."""
        return self._visible([vehicle.state.mean[:, 0] for vehicle in vehicles])

    def _hidden(self) -> BoolArray:
        """Return for each vehicle whether a present one hides it."""
        present = [vehicle.is_present for vehicle in self._vehicles]
        return are_hidden(self._boxes(self._vehicles), present)

    def _pair(self, observations: Sequence[Observation]) -> dict[int, int]:
        """Pair rows of vehicles with numbers of observations; present vehicles choose first.

        The values are squared, because one good pair is better than two poor ones. Lost vehicles
        are found again by `take_over_ids`.
        """
        if not (self._vehicles and observations):
            return {}
        vehicles = self._vehicles
        present = [row for row, vehicle in enumerate(vehicles) if vehicle.is_present]
        new = [row for row, vehicle in enumerate(vehicles) if not vehicle.confirmed]
        boxes = np.array([observation.box for observation in observations])
        buffers = np.array([vehicle.state.deviation for vehicle in vehicles])
        values = buffered_iou(self._boxes(vehicles), buffers, boxes)
        values[values < _OVERLAP] = 0
        expected = np.array([[vehicle.appearance] for vehicle in vehicles])
        observed = np.array([observation.appearance for observation in observations])
        values *= np.exp(-(differences(expected, observed) ** 2))
        scores = np.array([[vehicle.detection_scores.value] for vehicle in vehicles])
        values *= 1 - _UNSURE * (1 - scores)
        parts = are_parts(boxes, np.array([observation.score for observation in observations]))
        values[np.ix_(self._hidden(), parts)] = 0  # parts of the vehicle that hides it
        return pair(values**2, [present, new])

    def _is_clear(self, candidate: "_Candidate") -> bool:
        """Return whether a vehicle is large enough, and its score high enough, to be shown.

        A vehicle shown before may have a slightly lower score. If the left or right side of the
        frame cuts it off, its size is that of a car as wide as the visible part: a strip is not
        large.
        """
        left, _, right, _ = whole_box(candidate.position.mean)
        width, height = candidate.box[2:] - candidate.box[:2]
        if left < 0 or right > self._size[0]:
            height = min(height, _CAR_HEIGHT * width)
        is_large = width * height >= (self._settings.min_size * self._size[0]) ** 2
        minimum = self._settings.min_score * (1.0 if candidate.vehicle.id is None else _STAYS)
        return bool(is_large) and candidate.seen_score >= minimum

    def _track(self, candidate: "_Candidate") -> Track:
        vehicle = candidate.vehicle
        vehicle.id = next(self._ids) if vehicle.id is None else vehicle.id
        x1, y1, x2, y2 = candidate.box.tolist()
        left, _, right, bottom = whole_box(candidate.position.mean).tolist()
        return Track(
            vehicle.id,
            Box(x1, y1, x2, y2),
            candidate.score,
            candidate.position.state,
            class_name=vehicle.votes.winner,
            whole_foot=((left + right) / 2, bottom),
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    """A vehicle that may be shown at a time.

    `box` is its visible part, `(4,)`. `seen_score` and `score` are mean scores around that time,
    without and with misses as 0.
    """

    vehicle: TrackedVehicle
    position: Position
    box: Float64Array
    seen_score: float
    score: float

    @property
    def is_guess(self) -> bool:
        """Whether a search missed it at this time."""
        return self.position.bridges or self.position.state == "predicted"


def _boxes_of(candidates: Sequence[_Candidate]) -> Float64Array:
    return np.reshape([candidate.box for candidate in candidates], (-1, 4))


def _are_large(boxes: Float64Array) -> BoolArray:
    """Return for each box, `(n, 4)`, whether both sides are at least a pixel."""
    return np.asarray((boxes[:, 2:] - boxes[:, :2] >= 1).all(axis=1))
