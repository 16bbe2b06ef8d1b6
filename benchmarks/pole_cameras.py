"""Flows and speeds of drawn pole cameras, compared with the truth.

    python -m benchmarks.pole_cameras            # with the true boxes and the default detector
    python -m benchmarks.pole_cameras truth      # only with the true boxes

Thirty scenes: two streams, turning vehicles, a queue that stops on the line, lorries that hide
cars, and all of that together; each from three heights, with two seeds. Two lanes come near, two
drive away, and a side road joins from the left.
"""

import math
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from benchmarks.drawn_traffic import follow, true_tracks
from vdet.boxes import Float64Array
from vdet.config.scene import LineSettings, TrafficSettings
from vdet.config.schema import Settings
from vdet.detect.detectors import DetectorModel, load_detector
from vdet.lanes.camera import Ground, Undistorter, fit_ground
from vdet.synthetic import (
    LANE_WIDTH,
    LORRY,
    Body,
    PinholeCamera,
    Scene,
    SceneVehicle,
    Waypoint,
    empty_road,
    frames,
    random_body,
    random_paint,
)
from vdet.track.track import FrameTracks
from vdet.traffic.counting import count_frames
from vdet.traffic.speeds import SpeedMeter

WIDTH, HEIGHT = 1280, 720
HEIGHTS = (6.0, 8.0, 10.0)
KINDS = ("two streams", "turning", "queue", "lorries", "all")
SEEDS = (1, 2)
SECONDS = 16.0
RATE = Fraction(25, 2)
FRAMES = int(SECONDS * RATE)
NEAR = 0.05
"""Largest relative error of a speed that is right."""
MIN_IOU = 0.5
"""Of a shown box with that of the vehicle that it shows."""
MIN_WIDTH = 0.015
"""Fraction of the frame's width from which a true box is shown, as a tracker does."""

_FAR, _NEAR, _SIDE = 90.0, -15.0, -30.0  # metres; where lanes and the side road begin and end
_EDGE = 1.5 * LANE_WIDTH  # metres from the camera to the left edge of the road
_STEP = 0.1  # seconds between waypoints
_WAIT = 6.0  # seconds at which a queue drives on

Way = Float64Array
"""Points of a route, lateral and ahead in metres, `(n, 2)`."""


@dataclass(frozen=True)
class Trip:
    """A vehicle's way: the lines that it crosses, and how far along it is at each time."""

    way: Way
    flow: tuple[str, str]
    times: Float64Array
    gone: Float64Array
    body: Body

    def speed(self, time: float) -> float:
        """Return the true speed, m/s."""
        row = int(np.clip(np.searchsorted(self.times, time) - 1, 0, len(self.times) - 2))
        return float(np.diff(self.gone)[row] / np.diff(self.times)[row])

    def places(self, gone: Float64Array) -> Way:
        """Return the places along the way; before its start and after its end it goes on."""
        steps = np.hypot(*np.diff(self.way, axis=0).T)
        along = np.concatenate([[0], np.cumsum(steps)])
        ends = along[0] - 1e3, along[-1] + 1e3
        first, last = (self.way[i] - self.way[j] for i, j in ((1, 0), (-1, -2)))
        before = self.way[0] - 1e3 * first / np.hypot(*first)
        after = self.way[-1] + 1e3 * last / np.hypot(*last)
        at, points = np.array([ends[0], *along, ends[1]]), np.vstack([before, self.way, after])
        return np.column_stack([np.interp(gone, at, column) for column in points.T])


@dataclass(frozen=True)
class PoleScene:
    """A scene, the trips of its vehicles by id, its settings with lines, and its road plane."""

    name: str
    scene: Scene
    trips: dict[int, Trip]
    settings: Settings
    ground: Ground

    def true_tracks(self, every: int = 1) -> Iterator[FrameTracks]:
        """Give the true boxes of each frame, or of `every` N-th."""
        for index in range(0, self.scene.frames, every):
            tracks = true_tracks(self.scene, index, min_width=MIN_WIDTH * WIDTH)
            yield FrameTracks(index, self.scene.time(index), tracks)


def pole_scenes() -> Iterator[PoleScene]:
    """Give the thirty scenes."""
    for kind in KINDS:
        for above in HEIGHTS:
            for seed in SEEDS:
                yield pole_scene(kind, above, seed)


def pole_scene(kind: str, above: float, seed: int) -> PoleScene:
    """Return a scene of a kind, from a camera at this height in metres."""
    rng = np.random.default_rng([KINDS.index(kind), int(above), seed])
    camera = PinholeCamera.pole(WIDTH, HEIGHT, above)
    road = empty_road(rng, camera, lane=1, lanes=4, seed=seed)
    trips = dict(enumerate(_trips(rng, kind, above), start=1))
    vehicles = tuple(_driven(number, trip, rng) for number, trip in trips.items())
    scene = replace(road, vehicles=vehicles, roadside=(), speed=0.0, rate=RATE, frames=FRAMES)
    name = f"{kind}, {above:g} m, {seed}"
    return PoleScene(name, scene, trips, _lines(camera), _ground(camera))


def _lane(number: int) -> float:
    """Return the middle of a lane, metres to the right of the camera."""
    return (number - 1) * LANE_WIDTH


def _straight(number: int) -> tuple[Way, tuple[str, str]]:
    x = _lane(number)
    if number < 2:
        return np.array([(x, _FAR), (x, _NEAR)]), ("far left", "near left")
    return np.array([(x, _NEAR), (x, _FAR)]), ("near right", "far right")


def _turning(above: float, *, off: bool) -> tuple[Way, tuple[str, str]]:
    """Return the way from the first lane into the side road, or out of it."""
    x, radius, level = _lane(0), 5.0, 3.0 * above
    angles = np.linspace(0, math.pi / 2, 16)
    bend = np.column_stack([x - radius * (1 - np.cos(angles)), radius * np.sin(angles)])
    if off:
        way = np.vstack([(x, _FAR), bend * (1, -1) + np.array((0, level + radius)), (_SIDE, level)])
        return way, ("far left", "side")
    way = np.vstack([(x, _NEAR), bend + np.array((0, level - radius)), (_SIDE, level)])
    return way[::-1], ("side", "near left")


def _trips(rng: np.random.Generator, kind: str, above: float) -> Iterator[Trip]:
    """Give the trips of a scene; each crosses both of its lines while the clip runs."""
    near, far = 2.2 * above, 4.0 * above
    queues = kind in ("queue", "all")
    lorries = 0.35 if kind in ("lorries", "all") else 0.0
    for number in range(4):
        speed = rng.uniform(9, 16)
        if queues and number >= 2:
            yield from _queue(rng, number, near)
            continue
        start = rng.uniform(0.6, 2.0)
        turns = kind in ("turning", "all") and number == 0
        while start < SECONDS:
            body = LORRY if number in (1, 2) and rng.random() < lorries else random_body(rng)
            way, flow = _straight(number)
            own = speed * rng.uniform(0.97, 1.03)
            if turns:
                way, flow = _turning(above, off=bool(rng.random() < 0.6))
                own = rng.uniform(5.0, 7.0)
            times = np.arange(0, SECONDS + _STEP, _STEP)
            reach = 25.0 if flow[0] == "side" else _FAR - far if number < 2 else near - _NEAR
            gone = reach - 8 + own * (times - start)
            end = start + (far - near + 20) / own
            if end < SECONDS - 0.5:
                yield Trip(way, flow, times, gone, body)
            start += rng.uniform(1.6, 2.8) * (2.2 if turns else 1) + body.length / own


def _queue(rng: np.random.Generator, number: int, near: float) -> Iterator[Trip]:
    """Give vehicles that stop, the first with its rear on the line, and then drive on."""
    way, flow = _straight(number)
    times = np.arange(0, SECONDS + _STEP, _STEP)
    for place in range(2):
        stop = near - _NEAR - 7.5 * place + rng.uniform(-0.15, 0.15)
        arrives, leaves = rng.uniform(2.5, 3.5) + place, _WAIT + rng.uniform(0, 0.5) + place
        braking, pulling = rng.uniform(2.5, 3.5), rng.uniform(1.8, 2.5)
        before, after = np.maximum(0, arrives - times), np.maximum(0, times - leaves)
        full = 12 / braking
        way_in = np.where(before < full, braking * before**2 / 2, 12 * (before - full / 2))
        full = 12 / pulling
        way_out = np.where(after < full, pulling * after**2 / 2, 12 * (after - full / 2))
        yield Trip(way, flow, times, stop - way_in + way_out, random_body(rng))


def _driven(number: int, trip: Trip, rng: np.random.Generator) -> SceneVehicle:
    """Let a vehicle drive a trip: the middle of its rear follows the way."""
    length = trip.body.length
    rears = trip.places(trip.gone - length)  # the trip says where its front is
    ways = trip.places(trip.gone) - rears
    headings = np.unwrap(np.arctan2(ways[:, 0], ways[:, 1]))
    points = tuple(
        Waypoint(time, ahead, lateral, heading)
        for time, (lateral, ahead), heading in zip(
            trip.times.tolist(), rears.tolist(), headings.tolist(), strict=True
        )
    )
    return SceneVehicle(number, points, random_paint(rng), trip.body)


def _pixels(camera: PinholeCamera, *points: tuple[float, float]) -> Float64Array:
    return camera.project(np.array([(x, 0.0, z) for x, z in points], np.float64))


def _lines(camera: PinholeCamera) -> Settings:
    above = camera.above_ground
    near, far, level = 2.2 * above, 4.0 * above, 3.0 * above
    middle, right = _lane(1) + LANE_WIDTH / 2, _lane(3) + LANE_WIDTH / 2
    ends = {
        "far left": ((-_EDGE - 1, far), (middle - 0.2, far)),
        "near left": ((-_EDGE - 1, near), (middle - 0.2, near)),
        "near right": ((middle + 0.2, near), (right + 1, near)),
        "far right": ((middle + 0.2, far), (right + 1, far)),
        "side": ((-_EDGE - 4, level - 4), (-_EDGE - 4, level + 5)),
    }
    lines = []
    for name, points in ends.items():
        (ax, ay), (bx, by) = np.clip(_pixels(camera, *points) / (WIDTH, HEIGHT), 0, 1).tolist()
        lines.append(LineSettings(name=name, start=(ax, ay), end=(bx, by)))
    return Settings(traffic=TrafficSettings(lines=tuple(lines)))


def _ground(camera: PinholeCamera) -> Ground:
    above = camera.above_ground
    corners = [(x, z * above) for x in (-9.0, 12.0) for z in (1.4, 3.0, 6.5)]
    metres = np.array(corners, np.float64)
    return fit_ground(_pixels(camera, *corners), metres, Undistorter(None, WIDTH, HEIGHT))


@dataclass(frozen=True)
class Outcome:
    """What was measured of a scene.

    `flows` are the numbers that were found and that are true, by flow. `speeds` are the relative
    errors of the median speeds of vehicles, infinite where there is none.
    """

    flows: dict[tuple[str, str | None], tuple[int, int]]
    speeds: list[float]

    @property
    def exact(self) -> int:
        """The number of flows that are exact."""
        return sum(found == true for found, true in self.flows.values())

    @property
    def near(self) -> int:
        """The number of speeds that are right within 5 %."""
        return sum(abs(error) <= NEAR for error in self.speeds)


def measured(
    scene: PoleScene, shown: Sequence[FrameTracks], truth: Sequence[FrameTracks]
) -> Outcome:
    """Return what follows from the tracks that are shown."""
    found: Counter[tuple[str, str | None]] = Counter()
    for row in count_frames(shown, scene.settings, (WIDTH, HEIGHT)).flows():
        found[row.origin, row.destination] += row.count
    true: Counter[tuple[str, str | None]] = Counter(trip.flow for trip in scene.trips.values())
    flows = {way: (found[way], true[way]) for way in {*found, *true} if found[way] or true[way]}
    meter = SpeedMeter(scene.ground, WIDTH, HEIGHT)
    for frame in shown:
        meter.add(frame)
    known, same = meter.speeds(), _same(truth, shown)
    errors = []
    for number, trip in scene.trips.items():
        if (speeds := known.get(same.get(number, -1))) is None:
            errors.append(math.inf)
            continue
        rates = np.array([trip.speed(time) for time in speeds.times.tolist()])
        expected = replace(speeds, speeds=rates).quantile(0.5)
        errors.append(speeds.quantile(0.5) / expected - 1)
    return Outcome(flows, errors)


def _same(truth: Sequence[FrameTracks], shown: Sequence[FrameTracks]) -> dict[int, int]:
    """Return the track that overlaps each vehicle in most frames."""
    hits: dict[int, Counter[int]] = {}
    by_index = {frame.index: frame.tracks for frame in shown}
    for frame in truth:
        for true in frame.tracks:
            for track in by_index.get(frame.index, ()):
                if track.box.iou(true.box) > MIN_IOU:
                    hits.setdefault(true.id, Counter())[track.id] += 1
    return {number: found.most_common(1)[0][0] for number, found in hits.items()}


def detected(scene: PoleScene, model: DetectorModel) -> list[FrameTracks]:
    """Return the tracks of the default detector in the drawn frames."""
    results = follow(model, Settings(), scene.scene, frames(scene.scene))
    return [result.frame_tracks for result in results]


def main() -> None:
    """Measure all scenes; print a row for each, and the fractions of all."""
    names = sys.argv[1:] or ["truth", "detector"]
    model = load_detector(Settings().detector)
    outcomes: dict[str, list[Outcome]] = {name: [] for name in names}
    print("scene | flows exact | speeds within 5 % | wrong flows: found, true")
    for scene in pole_scenes():
        truth = list(scene.true_tracks())
        for name in names:
            outcome = measured(scene, truth if name == "truth" else detected(scene, model), truth)
            outcomes[name].append(outcome)
            wrong = {way: pair for way, pair in outcome.flows.items() if pair[0] != pair[1]}
            exact = f"{outcome.exact} of {len(outcome.flows)}"
            right = f"{outcome.near} of {len(outcome.speeds)}"
            print(f"{name}, {scene.name}", exact, right, wrong or "", sep=" | ", flush=True)
    for name, some in outcomes.items():
        rows = sum(len(outcome.flows) for outcome in some)
        vehicles = sum(len(outcome.speeds) for outcome in some)
        print(
            f"{name}: {sum(outcome.exact for outcome in some) / rows:.1%} of {rows} flows exact, "
            f"{sum(outcome.near for outcome in some) / vehicles:.1%} of {vehicles} speeds "
            f"within 5 %"
        )


if __name__ == "__main__":
    main()
