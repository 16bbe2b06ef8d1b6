"""The motion tracker, frame by frame: which detections and tracks show one vehicle.

Detections are assigned to vehicles by position and appearance. The order of the rounds is the
matching cascade of Wojke, Bewley and Paulus, "Simple Online and Realtime Tracking with a Deep
Association Metric", 2017; the buffered intersection over union is that of Yang et al., "Hard to
Track Objects with Irregular Motions and Similar Appearances? Make It Easier by Buffering the
Matching Space", 2023.

On a flat road, nearer vehicles are lower in the image. So of two overlapping vehicles, the one with
the lower bottom hides the other; two overlapping boxes at the same level show one vehicle, because
two would be in the same place.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress, count
from typing import Any

import numpy as np
import numpy.typing as npt

from vdet.boxes import (
    BoolArray,
    Box,
    Boxes,
    Float64Array,
    Int64Array,
    are_nested,
    clipped,
    coverage,
    iou,
    iou_matrix,
)
from vdet.config.schema import MotionTrackerSettings
from vdet.media import Picture
from vdet.track.motion.vehicle import (
    FrameStep,
    Observation,
    Position,
    TrackedVehicle,
    carried,
    whole_box,
)
from vdet.track.track import Track

_FREE = -1

# These limits were set by hand. What half and twice of each does was measured on 41 s of three real
# roads with 38 vehicles: the fraction of the rows of tracks that changes.

FIRST_STEP = 0.04
"""Seconds that the first frame counts for: as at 25 frames a second. Half: 30 % of one road. Twice:
nothing.
"""

_STAYS = 0.75
"""Fraction of the minimum score at which a vehicle that was shown before is still shown. Half: 9 to
11 % more on two roads. All: 8 to 9 % less.
"""

_CAR_HEIGHT = 0.8
"""Height of a car from behind as a fraction of its width. Half and twice: below 1 %."""

_OVERLAP = 0.3
"""Minimum intersection over union of a detection with the expected box of its vehicle. Half: 2 % of
one road. Twice: 2 to 12 % of each.
"""

_UNSURE = 0.2
"""Fraction by which the value of a pair is lower for a vehicle with score 0 than with score 1. Half
and twice: nothing.

A shadow tracked as a vehicle then does not take the detections of vehicles driving over it.
"""

WIDEST_BUFFER = 0.25
"""Maximum widening of a box on each side, fraction of its size. Half: 5 % of one road. Twice:
nothing.
"""

_MARGIN = 0.15
"""Fraction of width and height omitted at each side of a box: much of it is background. Half: 1 %
of one road. Twice: 1 to 7 % of each.
"""

_UNITS = 20.0, 6.0, 6.0
"""Differences of luma, blue and red chroma, in levels, that count as one unit. Half: 3 to 5 % of
each road. Twice: 4 to 6 % of two.

Most vehicles differ from each other by more, and from themselves a second ago by less.
"""

_REACH = 0.75
_REACH_GROWTH = 0.35
"""Maximum distance of a lost vehicle from its expected position, in sizes of the vehicle, and its
growth per second that the vehicle was hidden. Half: 5 % of one or two roads. Twice: nothing.
"""

_NEAR = 1.5
"""Maximum distance from a hidden vehicle to one that emerges, in sizes of the vehicle. Half: 5 % of
two roads. Twice: nothing.
"""

_OPPOSED, _UP_AND_DOWN = 0.55, 0.1
"""Minimum product of opposite velocities, in sizes per second, that belong to two vehicles, and the
same for their vertical components: a turning vehicle first changes its horizontal motion. Half and
twice: nothing.
"""

_MAX_UNLIKE = 1.2
"""Maximum difference in appearance between a lost vehicle and a new one that may be the same. Half:
5 % of one road. Twice: nothing.
"""

_GROWTH = 3.0
"""Maximum ratio of the areas of both boxes. Half: 5 % of one road. Twice: nothing."""

PART = 0.6
"""A detection with more than this fraction inside another vehicle is a part of it. Half, or all:
3 to 8 % of each road.
"""

HIDDEN = 0.5
"""A vehicle is hidden if a nearer one covers more than this fraction of it. Half: below 1 %. All:
2 to 6 % of each road.
"""

_LEVEL = 0.15
"""Bottoms that differ by less than this fraction of the smaller height are level. Half: nothing.
Twice: two vehicles of one road become one.
"""

_ALIKE = 0.5
"""Minimum intersection over union of two boxes that show one vehicle, level or not. Half: two
vehicles of one road become one. Never: 3 to 12 % of each road.
"""

_APART = 0.5
"""Seconds for which two tracks may follow one vehicle, which drives away from its track while
detections of its parts still hold that. After them, two tracks with detections are two vehicles,
even if they are level. Half and twice: nothing.
"""

CLEAR = 0.8
"""A detection on a nearer vehicle is a part of that vehicle if it scores less than this fraction.
Half: 5 % of two roads. Always: 3 to 15 % of each.
"""

_DOUBTED = 0.5
"""A detection is not a part of a vehicle that scores less than this fraction of the detection: the
box of that vehicle may span two vehicles that were seen as one. Half: nothing. Twice: 3 % of one
road.
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


def buffered_iou(
    expected: Float64Array, buffers: Float64Array, detected: Float64Array
) -> Float64Array:
    """Return how well each expected box fits each detected one, 0 to 1, `(n, m)`.

    Both boxes are widened by the buffer of the expected one, in fractions of their own sizes, so
    boxes that do not touch can still match if the motion is uncertain.

    Parameters
    ----------
    expected, detected
        Shapes `(n, 4)` and `(m, 4)`: x1, y1, x2, y2 in pixels, each with an area.
    buffers
        Shape `(n, 2)`: fractions of width and height by which a box is widened on each side.
    """
    fractions = np.minimum(buffers, WIDEST_BUFFER)[:, np.newaxis]
    return iou(_widened(expected[:, np.newaxis], fractions), _widened(detected, fractions))


def _widened(boxes: Float64Array, fractions: Float64Array | float) -> Float64Array:
    start, end = boxes[..., :2], boxes[..., 2:]
    margin = (end - start) * fractions
    return np.concatenate([start - margin, end + margin], axis=-1)


def appearances(picture: Picture | None, boxes: Float64Array) -> Float64Array:
    """Return the mean luma, blue and red chroma of the upper and the lower half of each box.

    Parameters
    ----------
    picture
        None if unknown.
    boxes
        float64 `(n, 4)`: x1, y1, x2, y2 in pixels, inside the picture, with an area.

    Returns
    -------
    float64 `(n, 2, 3)`: levels from 0 to 255, as in the planes; NaN without a picture.
    """
    if picture is None or not len(boxes):
        return np.full((len(boxes), 2, 3), np.nan)
    inner = _widened(boxes, -_MARGIN)
    halves = np.stack([inner, inner], axis=1)
    halves[:, 0, 3] = halves[:, 1, 1] = inner[:, [1, 3]].mean(axis=1)
    means = [picture.mean_color(half) for half in halves.reshape(-1, 4)]
    return np.reshape(means, (-1, 2, 3))


def differences(a: Float64Array, b: Float64Array) -> Float64Array:
    """Return the difference of appearances, `(…, 2, 3)`: 0 if they are equal or unknown."""
    units = (a - b) / _UNITS
    return np.asarray(np.sqrt(np.nan_to_num(units**2).mean(axis=(-2, -1))))


def pair(values: Float64Array, rounds: Sequence[Sequence[int]]) -> dict[int, int]:
    """Pair rows with columns, each at most once.

    Parameters
    ----------
    values
        Shape `(n, m)`: the value of a pair; 0 if it is not allowed.
    rounds
        Rows; those of a later round choose from the columns left by the earlier ones.

    Returns
    -------
    The column of each paired row; each round maximizes the sum of values.
    """
    remaining = values.copy()
    pairs: dict[int, int] = {}
    for rows in rounds:
        paired, columns = assign(remaining[list(rows)])
        pairs |= {rows[row]: column for row, column in zip(paired, columns.tolist(), strict=True)}
        remaining[:, list(pairs.values())] = 0
    return pairs


def assign(values: npt.NDArray[Any]) -> tuple[Int64Array, Int64Array]:
    """Pair rows with columns, each at most once, to maximize the sum of the values.

    Same as `scipy.optimize.linear_sum_assignment`, whose import would cost every run about 50 MB
    and startup time. Source: Jonker and Volgenant, "A Shortest Augmenting Path Algorithm for Dense
    and Sparse Linear Assignment Problems", 1987, without its first phases.

    Parameters
    ----------
    values
        Shape `(n, m)`, at least 0.

    Returns
    -------
    Rows and columns of the pairs with a value above 0, rows ascending.
    """
    rows, columns = len(values), max(values.shape)  # each row gets a column, perhaps an added one
    costs, row_of = np.zeros((rows, columns)), np.full(columns, _FREE)
    costs[:, : values.shape[1]] -= values
    of_rows, of_columns = np.zeros(rows), np.zeros(columns)  # the dual variables
    for row in range(rows):
        # Search the cheapest path from this row to a free column.
        lengths, previous = np.full(columns, np.inf), np.full(columns, _FREE)
        is_open = np.ones(columns, np.bool_)
        current, column, shortest = row, _FREE, 0.0
        while current != _FREE:
            reached = shortest + costs[current] - of_rows[current] - of_columns
            shorter = is_open & (reached < lengths)
            lengths[shorter], previous[shorter] = reached[shorter], column
            column = int(np.where(is_open, lengths, np.inf).argmin())
            shortest, is_open[column] = float(lengths[column]), False
            current = int(row_of[column])
        passed = np.flatnonzero(~is_open & (row_of != _FREE))
        change = shortest - lengths[passed]
        of_rows[row] += shortest
        of_rows[row_of[passed]] += change
        of_columns[passed] -= change
        # The rows along the path change their columns.
        while column != _FREE:
            before = int(previous[column])
            row_of[column] = row if before == _FREE else row_of[before]
            column = before
    column_of, used = np.empty(rows, np.int64), np.flatnonzero(row_of != _FREE)
    column_of[row_of[used]] = used
    paired = np.flatnonzero(costs[np.arange(rows), column_of] < 0)
    return paired, column_of[paired]


def are_hidden(boxes: Float64Array, present: Sequence[bool]) -> BoolArray:
    """Return for each box whether another one covers more than half of it and is not farther away.

    Parameters
    ----------
    boxes
        Shape `(n, 4)`: x1, y1, x2, y2 in pixels, each with an area.
    present
        Whether each of them can hide others.
    """
    bottoms = boxes[:, 3]
    farther = bottoms < (bottoms - _LEVEL * (bottoms - boxes[:, 1]))[:, np.newaxis]
    hiding = (coverage(boxes, boxes) > HIDDEN) & np.array(present, bool) & ~farther
    np.fill_diagonal(hiding, val=False)
    return np.asarray(hiding.any(axis=1))


def are_parts(boxes: Float64Array, scores: Float64Array) -> BoolArray:
    """Return for each box, `(n, 4)`, whether most of it is inside one with a higher score.

    A vehicle that emerges from behind another one has nearly the same score, and is not a part.

    Returns
    -------
    bool `(n,)`.
    """
    weaker = scores[:, np.newaxis] < CLEAR * scores
    return np.asarray(((coverage(boxes, boxes) > PART) & weaker).any(axis=1))


def take_over_ids(vehicles: Sequence[TrackedVehicle]) -> list[TrackedVehicle]:
    """Pass the ids of lost vehicles to newly confirmed ones at their expected positions.

    A single detection is not enough: a vehicle that is found again is tracked as a new one at
    first.

    Returns
    -------
    The vehicles without the lost ones that were found.
    """
    remaining = list(vehicles)
    for new in vehicles:
        if not new.confirmed or new.unseen or new.id is not None:
            continue
        lost = [v for v in remaining if v.confirmed and v.unseen and _may_be(v, new)]
        if lost:
            nearest = min(lost, key=lambda vehicle: _astray(vehicle, new))
            new.take_over(nearest)
            remaining.remove(nearest)
    return remaining


def without_duplicates(
    vehicles: Sequence[TrackedVehicle], boxes: Float64Array
) -> list[TrackedVehicle]:
    """Keep one track for each vehicle: the one with the highest score, else the oldest one.

    It keeps the id that has not been lost for longer. An unconfirmed track does not replace another
    one; it stays beside it while its score is higher.

    Parameters
    ----------
    boxes
        Their visible parts, x1, y1, x2, y2, `(n, 4)`.
    """
    inside, alike = coverage(boxes, boxes) > PART, iou_matrix(boxes, boxes) > _ALIKE
    overlaps = inside | inside.T
    bottoms, heights = boxes[:, 3], boxes[:, 3] - boxes[:, 1]
    same = abs(bottoms - bottoms[:, None]) < _LEVEL * np.minimum(heights, heights[:, None])
    same |= alike
    hidden = [vehicle for vehicle in vehicles if vehicle.hidden]
    kept: list[int] = []

    def rank(row: int) -> tuple[bool, float]:
        vehicle = vehicles[row]  # confirmed ones come first; nearly equal ones keep their order
        return not vehicle.confirmed, -round(vehicle.scores.value, 2)

    for row in sorted(range(len(vehicles)), key=rank):
        vehicle = vehicles[row]
        overlapping = [at for at in kept if overlaps[row, at]]
        for at in () if vehicle.unseen else overlapping:
            higher = vehicles[at]
            if higher.unseen or not higher.confirmed:
                continue
            boxes_are = {"inside": inside[row, at], "same": same[row, at], "alike": alike[row, at]}
            if not _show_one_vehicle(vehicle, higher, hidden, **boxes_are):
                continue
            if vehicle.confirmed and min(vehicle.age, higher.age) > _APART:
                vehicle.lose()  # it was apart, and now shows the vehicle that hides its own
                kept.append(row)
            elif vehicle.confirmed:
                higher.merge(vehicle)
            break
        else:  # apart from all of them
            kept.append(row)
    return [vehicles[row] for row in sorted(kept)]


def _show_one_vehicle(
    vehicle: TrackedVehicle,
    higher: TrackedVehicle,
    hidden: Sequence[TrackedVehicle],
    *,
    inside: bool,
    same: bool,
    alike: bool,
) -> bool:
    """Return whether a track shows the vehicle of an overlapping one of higher rank, or a part.

    Both are detected. Most of its box may be `inside` the other one; the boxes may be `alike`, or
    the `same` vehicle's: alike or level. An unconfirmed track inside the other box may also be one
    of the `hidden` vehicles that emerges, or one of two vehicles that this box spans.
    """
    if min(vehicle.age, higher.age) > _APART:
        return alike
    if vehicle.confirmed:
        return same
    if vehicle.scores.value <= higher.scores.value and same:
        return True
    is_doubted = higher.detection_scores.value < _DOUBTED * vehicle.detection_scores.value
    return inside and not (is_doubted or _comes_out(vehicle, higher, hidden))


def _comes_out(
    vehicle: TrackedVehicle, nearer: TrackedVehicle, hidden: Sequence[TrackedVehicle]
) -> bool:
    """Return whether a `hidden` vehicle was near, and this one is as clear as the nearer one."""
    is_clear = vehicle.detection_scores.value > CLEAR * nearer.detection_scores.value
    position = vehicle.state.mean[:, 0]
    return is_clear and any(_distance(item.state.mean[:, 0], position) < _NEAR for item in hidden)


def _may_be(lost: TrackedVehicle, new: TrackedVehicle) -> bool:
    """Return whether a new vehicle may be the lost one.

    It is at the expected position, looks alike, does not drive the other way, and did not exist
    before.
    """
    beside = lost.history.last_seen.time - new.begin
    if beside >= _APART or _astray(lost, new) >= _REACH + _REACH_GROWTH * lost.hidden:
        return False
    across, down = lost.history.last_seen.state.velocity * new.history.last_seen.state.velocity
    turned = across + down < -_OPPOSED or down < -_UP_AND_DOWN
    return not turned and bool(differences(lost.appearance, new.appearance) < _MAX_UNLIKE)


def _astray(lost: TrackedVehicle, new: TrackedVehicle) -> float:
    """Return the distance of a new vehicle from the expected position of a lost one, in sizes.

    Its current position also counts if only a part may have been seen at first: the lost vehicle
    was hidden, or the first box has another size.
    """
    last, first = lost.history.last_seen, new.history.estimates[0]
    expected = carried(last.state.mean, max(first.time - last.time, 0.0))
    at_first = _distance(expected, new.history.means()[0][:, 0])
    now = _distance(lost.state.mean[:, 0], new.state.mean[:, 0])
    return min(at_first, now) if lost.hidden or math.isinf(at_first) else at_first


def _distance(a: Float64Array, b: Float64Array) -> float:
    """Return the distance of two positions in mean sizes; infinite if the sizes differ too much.

    Parameters
    ----------
    a, b
        Centre x and y and log width and height, `(4,)`.
    """
    if abs(float(np.sum(a[2:] - b[2:]))) > math.log(_GROWTH):
        return math.inf
    sizes = (np.exp(a[2:]) + np.exp(b[2:])) / 2
    return math.hypot(*((a[:2] - b[:2]) / sizes))
