"""The motion tracker, frame by frame."""

from collections.abc import Sequence
from itertools import count

import numpy as np

from vdet.boxes import BoolArray, Box, Boxes, Float64Array, are_nested, clipped
from vdet.config.schema import MotionTrackerSettings
from vdet.media import Picture
from vdet.track.motion.association import are_hidden, are_parts, take_over_ids, without_duplicates
from vdet.track.motion.pairing import appearances, buffered_iou, differences, pair
from vdet.track.motion.state import whole_box
from vdet.track.motion.vehicle import Look, Observation, Place, Vehicle
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
        self._vehicles: list[Vehicle] = []
        self._ids = count(1)
        self._time: float | None = None
        self._gone: list[Vehicle] = []  # no longer tracked, but shown at earlier times

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
        self._time, look = time, Look(time, seconds, self._size)
        longest = self._settings.keep_id_seconds + self._settings.keep_hidden_id_seconds
        self._keep([v for v in self._vehicles if v.unseen + seconds <= longest])
        for vehicle in self._vehicles:
            vehicle.predict(seconds)
        self._keep(self._staying())
        pairs = self._pair(observations)
        for row, vehicle in enumerate(self._vehicles):
            if row in pairs:
                vehicle.see(observations[pairs[row]], look)
            else:
                vehicle.miss(look)
        self._keep(self._staying())
        left = [o for number, o in enumerate(observations) if number not in pairs.values()]
        # Detections with scores below the decay never add up to a vehicle.
        new = [Vehicle(o, look, self._settings) for o in left if o.score > self._settings.decay]
        vehicles = take_over_ids(self._vehicles + new)
        self._vehicles = without_duplicates(vehicles, self._boxes(vehicles))
        before = time - 2 * self._settings.look_ahead
        self._gone = [vehicle for vehicle in self._gone if vehicle.history.last_seen.time >= before]
        for vehicle, hidden in zip(self._vehicles, self._hidden(), strict=True):
            vehicle.hidden += seconds * (bool(hidden) and vehicle.unseen > 0)
            vehicle.history.forget(before)

    def at(self, time: float) -> list[Track]:
        """Return the vehicles shown at a time; see `TimedTracker.at`."""
        known = [*self._gone, *(vehicle for vehicle in self._vehicles if vehicle.confirmed)]
        placed = [(v, place) for v in known if (place := self._place(v, time)) is not None]
        every_box = self._visible([place.mean for _, place in placed])
        rows = np.flatnonzero(_are_large(every_box))
        placed, boxes = [placed[row] for row in rows], every_box[rows]
        hidden = are_hidden(boxes, [place.state != "predicted" for _, place in placed])
        shown: list[tuple[Vehicle, Place, Float64Array, float]] = []
        for (vehicle, place), box, is_hidden in zip(placed, boxes, hidden, strict=True):
            seen_score, score = vehicle.history.scores(time)
            is_guess = place.bridges or place.state == "predicted"
            if self._is_clear(vehicle, place, box, seen_score) and not (is_hidden and is_guess):
                shown.append((vehicle, place, box, score))
        shown_boxes = np.reshape([box for _, _, box, _ in shown], (-1, 4))
        nested = are_nested(shown_boxes, [score for *_, score in shown])
        pairs = zip(shown, nested, strict=True)
        tracks = [self._track(*item) for item, is_nested in pairs if not is_nested]
        return sorted(tracks, key=lambda track: track.id)

    def _place(self, vehicle: Vehicle, time: float) -> Place | None:
        """Return the place of a vehicle at a time; None if it is not shown then."""
        assert self._time is not None
        history = vehicle.history
        place = history.at(time, self._settings.look_ahead)
        if place is not None or time < history.last_seen.time or vehicle in self._gone:
            return place
        if not vehicle.is_present:
            return None
        mean = vehicle.state.moved(time - self._time)
        return Place(mean[:, 0], "predicted" if vehicle.unseen else "interpolated")

    def _keep(self, vehicles: list[Vehicle]) -> None:
        """Track only these vehicles; the others, if confirmed, can be shown at earlier times."""
        self._gone += [v for v in self._vehicles if v.confirmed and v not in vehicles]
        self._vehicles = vehicles

    def _staying(self) -> list[Vehicle]:
        """Return the vehicles that are neither ended nor outside the frame."""
        are_inside = _are_large(self._boxes(self._vehicles))
        pairs = zip(self._vehicles, are_inside, strict=True)
        return [vehicle for vehicle, is_inside in pairs if is_inside and not vehicle.is_over]

    def _observations(self, detections: Boxes, picture: Picture | None) -> list[Observation]:
        boxes = clipped(detections.sides, self._size)
        columns = detections.scores.tolist(), detections.likely_classes
        rows = zip(boxes, *columns, appearances(picture, boxes), strict=True)
        large = _are_large(boxes)
        return [Observation(*row) for row, is_large in zip(rows, large, strict=True) if is_large]

    def _visible(self, means: Sequence[Float64Array]) -> Float64Array:
        """Return the part in the frame of each centre and size, `(n, 4)`; see `Place`."""
        return clipped(whole_box(np.reshape(means, (-1, 4))), self._size)

    def _boxes(self, vehicles: Sequence[Vehicle]) -> Float64Array:
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
        found = np.array([observation.box for observation in observations])
        buffers = np.array([vehicle.state.deviation for vehicle in vehicles])
        values = buffered_iou(self._boxes(vehicles), buffers, found)
        values[values < _OVERLAP] = 0
        known = np.array([[vehicle.appearance] for vehicle in vehicles])
        looks = np.array([observation.appearance for observation in observations])
        values *= np.exp(-(differences(known, looks) ** 2))
        scores = np.array([[vehicle.detection_scores.value] for vehicle in vehicles])
        values *= 1 - _UNSURE * (1 - scores)
        parts = are_parts(found, np.array([observation.score for observation in observations]))
        values[np.ix_(self._hidden(), parts)] = 0  # parts of the vehicle that hides it
        return pair(values**2, [present, new])

    def _is_clear(self, vehicle: Vehicle, place: Place, box: Float64Array, score: float) -> bool:
        """Return whether a vehicle is large enough, and its score high enough, to be shown.

        A vehicle shown before may have a slightly lower score. If the left or right side of the
        frame cuts it off, its size is that of a car as wide as the visible part: a strip is not
        large.
        """
        left, _, right, _ = whole_box(place.mean)
        width, height = box[2:] - box[:2]
        if left < 0 or right > self._size[0]:
            height = min(height, _CAR_HEIGHT * width)
        is_large = width * height >= (self._settings.min_size * self._size[0]) ** 2
        minimum = self._settings.min_score * (1.0 if vehicle.id is None else _STAYS)
        return bool(is_large) and score >= minimum

    def _track(self, vehicle: Vehicle, place: Place, box: Float64Array, score: float) -> Track:
        vehicle.id = next(self._ids) if vehicle.id is None else vehicle.id
        return Track(
            vehicle.id,
            Box(*box.tolist()),
            score,
            place.state,
            class_name=vehicle.votes.winner,
            whole_foot=Box(*whole_box(place.mean).tolist()).foot,
        )


def _are_large(boxes: Float64Array) -> BoolArray:
    """Return for each box, `(n, 4)`, whether both sides are at least a pixel."""
    return np.asarray((boxes[:, 2:] - boxes[:, :2] >= 1).all(axis=1))
