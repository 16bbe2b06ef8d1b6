"""A track and its class, the protocol of trackers, and how one is made from settings.

The class of a track is a vote of all searches that found the vehicle. Only trackers vote. Each row
of a track has its class so far; counts, records and pages, made at the end of a video, use that of
the last row.
"""

from collections import defaultdict, deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, dataclass, field, replace
from math import inf
from typing import Any, Literal, Protocol, runtime_checkable

import numpy as np

from vdet.boxes import Box, Boxes, Float64Array, cut_sides
from vdet.config.classes import UNKNOWN
from vdet.config.kinds import TrackerKind
from vdet.config.schema import Settings
from vdet.media import Picture
from vdet.plugins import TRACKERS, load_plugin
from vdet.regions import Regions

State = Literal["detected", "interpolated", "predicted"]
"""Source of a box in a frame: see `Track`."""

_USUAL, _USUAL_NEEDS = "car", 0.6
"""The class that detectors take for small or unclear vehicles of every kind, and the fraction of
all votes that it needs. On images that it has not seen, the shipped network is sure of cars to
0.93, but takes trucks and buses for cars to a third or a half.
"""

_UNUSUAL_NEED, _BESIDE_USUAL = 0.3, 2 / 3
"""Fractions of all votes, and of those of the usual class, that another class needs; without one,
the class is `UNKNOWN`. If all classes needed 2/3 of all votes, one lorry of three real clips would
not be called a bus, and three would no longer be called trucks.
"""

_CLOSE = 0.05
"""Fraction of the frame's area above which a larger box does not help to tell classes apart."""

_CUT_OFF = 0.1
"""Weight of a search that shows only a part of the vehicle: a cut-off truck looks like a car."""


@dataclass(frozen=True, slots=True)
class Track:
    """A vehicle as shown in one frame.

    Attributes
    ----------
    id
        1, 2, 3 … in the order in which the tracker first shows the vehicles of a video; ids are
        never reused. Steps that hide a track leave gaps.
    box
        In pixels of the full frame. From the motion tracker: the estimate for this frame, clipped
        to it. From the rules tracker: the average of the last `tracker.history` rectangles, in
        whole pixels, inside the frame.
    score
        0 to 1: the fraction of shown boxes with such a score that are vehicles.
    state
        "detected": the detector found the vehicle in this frame. "interpolated": the detector found
        it before and after, or the frame was not searched; the box lies between detections.
        "predicted": the detector did not find it again; the box follows its motion or, with the
        rules tracker, a match of its image.
    class_name
        Its class, one of `Boxes.names`; None if the detector has no classes.
    whole_foot
        Middle of the lower edge of the whole box, including the part outside the frame; x and y,
        pixels. None if unknown: see `foot`.
    distance
        Metres along the road from the camera to the vehicle; None if unknown.
    lane
        0 for the camera's lane, 1 for the next one to the right, -1 to the left and so on; None if
        unknown.
    position
        Where the box stands in the file that it was read from: its line, or a name such as
        "annotations.3". Its class is then named as there, and its score 1 if there is none.
    ignored
        Whether it is an ignore region of labelled images or videos, not a vehicle.
    """

    id: int
    box: Box
    score: float
    state: State
    class_name: str | None = None
    whole_foot: tuple[float, float] | None = None
    distance: float | None = None
    lane: int | None = None
    position: int | str = field(default=0, compare=False)
    ignored: bool = False

    @property
    def foot(self) -> tuple[float, float]:
        """Its ground point: the middle of the lower edge of the whole box, x and y in pixels."""
        return self.whole_foot or self.box.foot

    @property
    def written_foot(self) -> tuple[float, float]:
        """`foot` as written to files, to a hundredth of a pixel."""
        x, y = self.whole_foot or self.box.foot
        return round(100 * x) / 100, round(100 * y) / 100  # round(x, 2) is three times slower

    def label(self, parts: Sequence[str]) -> str:
        """Return the text of a label: those of the parts id, class, score, distance it has."""
        texts = {"id": str(self.id), "class": self.class_name, "score": f"{self.score:.2f}"}
        texts["distance"] = None if self.distance is None else f"{self.distance:.0f} m"
        return " ".join(text for part in parts if (text := texts[part]))


@dataclass(frozen=True, slots=True)
class FrameTracks:
    """The vehicles shown in one frame of a video.

    Attributes
    ----------
    index
        Number of the frame, from 0 at the start of the video.
    time
        Presentation time of the frame, seconds.
    tracks
        By id.
    facts
        More about the frame, as values for JSON: `lane` if lane finding is enabled.
    is_cut
        Whether a jump cut comes before it, so that no track goes on.
    """

    index: int
    time: float
    tracks: tuple[Track, ...]
    facts: Mapping[str, Any] = field(default_factory=dict)
    is_cut: bool = False

    def inside(self, regions: Regions) -> "FrameTracks":
        """Return the frame with the vehicles that are in a region in which they are shown."""
        kept = tuple(track for track in self.tracks if regions.contains(track.foot))
        return replace(self, tracks=kept)

    @property
    def boxes(self) -> Boxes:
        """The vehicles as boxes with ids; without classes if one of them has none."""
        names = sorted({track.class_name for track in self.tracks if track.class_name})
        every = [track.class_name for track in self.tracks]
        return Boxes(
            [astuple(track.box) for track in self.tracks],
            [track.score for track in self.tracks],
            classes=None if None in every else [names.index(str(name)) for name in every],
            names=names,
            ids=[track.id for track in self.tracks],
        )


class VideoTracker(Protocol):
    """Tracks the vehicles of one video; every video gets a new tracker."""

    def update(self, detections: Boxes, time: float, picture: Picture | None = None) -> list[Track]:
        """Follow the vehicles into the next frame.

        Parameters
        ----------
        detections
            The detections in the frame.
        time
            Presentation time of the frame, seconds; increases from frame to frame.
        picture
            The frame; only trackers that look at pixels need it.

        Returns
        -------
        The vehicles shown in this frame, by id.

        Raises
        ------
        ValueError
            The tracker looks at pixels, and `picture` is None.
        """


@runtime_checkable
class TimedTracker(Protocol):
    """A tracker that knows its vehicles at any time, also between searched frames.

    `vdet.track.track.timed` makes one from a `VideoTracker`.
    """

    def observe(self, detections: Boxes, time: float, picture: Picture | None = None) -> None:
        """Track the vehicles into the next frame; parameters as for `VideoTracker.update`."""

    def at(self, time: float) -> list[Track]:
        """Return the vehicles shown at a time, by id.

        Parameters
        ----------
        time
            Seconds; not earlier than in the previous call, and at most `tracker.look_ahead` before
            the latest `observe`. Later detections are used where they are known; after the latest
            `observe`, the vehicles move on.
        """


class ClassVotes:
    """The votes of the searches that found a vehicle, by class."""

    def __init__(self) -> None:
        self._sums: defaultdict[str, float] = defaultdict(float)

    @property
    def winner(self) -> str | None:
        """The class with the most votes, or `UNKNOWN`; None if no detection had a class."""
        if not self._sums:
            return None
        total, unusual = sum(self._sums.values()), dict(self._sums)
        usual = unusual.pop(_USUAL, 0.0)
        if usual >= _USUAL_NEEDS * total or not unusual:
            return _USUAL
        name = max(unusual, key=unusual.__getitem__)
        needed = max(_UNUSUAL_NEED * total, _BESIDE_USUAL * usual)
        return name if unusual[name] >= needed else UNKNOWN

    def add(self, classes: Mapping[str, float], weight: float) -> None:
        """Add the votes of a search: the probability of each class, times the weight."""
        for name, probability in classes.items():
            self._sums[name] += weight * probability

    def join(self, votes: "ClassVotes") -> None:
        """Add the votes of another track of the same vehicle."""
        self.add(votes._sums, 1.0)


def vote_weight(box: Float64Array, score: float, size: tuple[int, int]) -> float:
    """Return the weight of a detection for the class: by its area and score, and if it is whole.

    Parameters
    ----------
    box
        x1, y1, x2, y2 in pixels, inside the frame.
    score
        0 to 1.
    size
        Width and height of the frame, pixels.
    """
    x1, y1, x2, y2 = map(float, box / (*size, *size))
    area = min((x2 - x1) * (y2 - y1), _CLOSE)
    return score * area * (_CUT_OFF if any(cut_sides((x1, y1, x2, y2), (1, 1))) else 1)


def make_tracker(settings: Settings, width: int, height: int) -> TimedTracker:
    """Return a new tracker for the frames of one video, `width` × `height` pixels.

    Raises
    ------
    ConfigError
        The kind is unknown.
    """
    kind: TrackerKind = load_plugin(TRACKERS, settings.tracker.kind)
    return timed(kind.make(settings.tracker, width, height))


def timed(tracker: VideoTracker) -> TimedTracker:
    """Return a tracker that knows its vehicles at any time: the tracker itself, or a wrapper.

    With the wrapper, vehicles move straight from one box to the next between two searched frames;
    after the latest frame they stay where they are.
    """
    return tracker if isinstance(tracker, TimedTracker) else InterpolatingTracker(tracker)


class InterpolatingTracker:
    """Shows the tracks of another tracker at any time; a `TimedTracker`.

    Attributes
    ----------
    tracker
        The wrapped tracker. It receives only searched frames, with their times.
    """

    def __init__(self, tracker: VideoTracker) -> None:
        self.tracker = tracker
        self._searched: list[tuple[float, list[Track]]] = []

    def observe(self, detections: Boxes, time: float, picture: Picture | None = None) -> None:
        """Follow the vehicles into the next frame; as `TimedTracker.observe`."""
        self._searched.append((time, self.tracker.update(detections, time, picture)))

    def at(self, time: float) -> list[Track]:
        """Return the vehicles shown at a time; as `TimedTracker.at`."""
        while len(self._searched) > 1 and self._searched[1][0] <= time:
            del self._searched[0]
        if not self._searched:
            return []
        begin, tracks = self._searched[0]
        if time <= begin:
            return tracks
        end, following = self._searched[1] if len(self._searched) > 1 else (inf, tracks)
        ends = {track.id: track for track in following}
        fraction = (time - begin) / (end - begin)
        return [_moved(track, ends[track.id], fraction) for track in tracks if track.id in ends]


class ShotTracker:
    """Shows the tracks of a new tracker after each jump cut; a `TimedTracker`. Ids go on.

    Parameters
    ----------
    make
        Makes a tracker.
    """

    def __init__(self, make: Callable[[], TimedTracker]) -> None:
        self._make = make
        self._shots = deque([(-inf, make())])
        self._shift = self._largest = 0

    def begin_shot(self, time: float) -> None:
        """End all tracks before a frame, of which this is the time; none later was observed."""
        self._shots.append((time, self._make()))

    def observe(self, detections: Boxes, time: float, picture: Picture | None = None) -> None:
        """Follow the vehicles into the next frame; as `TimedTracker.observe`."""
        self._shots[-1][1].observe(detections, time, picture)

    def at(self, time: float) -> list[Track]:
        """Return the vehicles shown at a time; as `TimedTracker.at`."""
        while len(self._shots) > 1 and self._shots[1][0] <= time:
            self._shots.popleft()
            self._shift = self._largest
        tracks = self._shots[0][1].at(time)
        if self._shift:
            tracks = [replace(track, id=track.id + self._shift) for track in tracks]
        self._largest = max([self._largest, *(track.id for track in tracks)])
        return tracks


def _moved(track: Track, end: Track, fraction: float) -> Track:
    """Return a track that has done this fraction of its way to `end`."""
    first, last = (np.array([*astuple(item.box), *item.foot]) for item in (track, end))
    x1, y1, x2, y2, foot_x, foot_y = (first + (last - first) * fraction).tolist()
    state: State = "predicted" if track.state == "predicted" else "interpolated"
    return replace(track, box=Box(x1, y1, x2, y2), whole_foot=(foot_x, foot_y), state=state)
