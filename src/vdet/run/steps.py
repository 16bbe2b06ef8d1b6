"""The result of a frame, and the steps that change it, between the tracker and the sinks.

A step is made for one video or one image. An entry point of the group `vdet.steps` is a function
that takes a `StepContext` and returns a step, or None if the settings do not enable it.
"""

import itertools
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, cast, runtime_checkable

import cv2

from vdet.boxes import Box, Boxes, Image, has_moved
from vdet.config.classes import UNKNOWN, is_chosen
from vdet.config.schema import Settings
from vdet.draw import color_of, draw_box
from vdet.errors import ConfigError
from vdet.findings import Findings
from vdet.media import Frame, VideoInfo
from vdet.plugins import STEPS, load_plugin
from vdet.polygons import Point
from vdet.regions import Regions
from vdet.track.track import FrameTracks, Track

if TYPE_CHECKING:
    from vdet.conditions.watch import Conditions
    from vdet.lanes.road import Road, RoadFinder

_CELL = 0.01
"""Side of the cells in which vehicles drove, as a fraction of the width."""
_KEYS = {"frame", "time", "tracks", "clock", "video", "findings", "last", "image", "boxes"}
"""Keys of a record, which no fact about a frame may have."""
FINDINGS = "conditions"
"""Name of the fact that has the reasons to doubt the results of a video."""


class Fact(Protocol):
    """A result of a step about a frame or a whole video: a frozen value of any type.

    Each line of the `str` of a fact about a whole video is printed as a warning.
    """

    def record(self) -> Any:
        """Return it as values for JSON."""


Facts = Mapping[str, Fact]
"""Facts by their names, which are their keys in JSON."""


def findings_in(facts: Facts) -> Findings:
    """Return the reasons to doubt the results of a video."""
    return cast("Findings", facts.get(FINDINGS, Findings()))


@dataclass(frozen=True)
class FrameResult:
    """A frame, its detections, the vehicles shown, and facts about it.

    Attributes
    ----------
    source
        The video or image file.
    frame
        The frame as read. All sinks share the same image, so none may change it.
    detections, tracks
        In pixels of that frame.
    facts
        Results of steps about it, by name; the lane is "lane".
    searched
        Whether the detector searched the frame: see `detector.searches_per_second`. Without a
        search there are no detections.
    unselected
        The tracks of classes that are not selected; empty if all are.
    is_cut
        Whether a jump cut comes before it: the video was put together there.
    """

    source: Path
    frame: Frame
    detections: Boxes
    tracks: tuple[Track, ...]
    facts: Facts = field(default_factory=dict)
    searched: bool = True
    unselected: tuple[Track, ...] = ()
    is_cut: bool = False

    @property
    def road(self) -> "Road | None":
        """The lane; None if lane finding is disabled."""
        return cast("Road | None", self.facts.get("lane"))

    @cached_property
    def frame_tracks(self) -> FrameTracks:
        """The tracks with the number, time and facts of the frame."""
        facts = {name: fact.record() for name, fact in self.facts.items()}
        index, time = self.frame.index, float(self.frame.time)
        return FrameTracks(index, time, self.tracks, facts, self.is_cut)

    def __post_init__(self) -> None:
        if taken := _KEYS & self.facts.keys():
            raise ConfigError(
                f"{min(taken)}: a step must name its fact differently: outputs have it"
            )

    def of_classes(self, classes: Collection[str]) -> "FrameResult":
        """Return the result with only the tracks of some classes; empty for all."""
        chosen = tuple(track for track in self.tracks if is_chosen(track.class_name, classes))
        rest = (track for track in self.tracks if not is_chosen(track.class_name, classes))
        return replace(self, tracks=chosen, unselected=tuple(rest)) if classes else self

    def draw_tracks(self, image: Image, parts: Sequence[str]) -> None:
        """Draw the boxes of the tracks, each in a colour of its own, with these parts of labels."""
        for track in self.tracks:
            text, is_dashed = track.label(parts), track.state == "predicted"
            draw_box(image, track.box, color_of(track.id), text, dashed=is_dashed)

    def _repr_png_(self) -> bytes:
        """Return the frame with its vehicles, for notebooks."""
        image = self.frame.image.copy()
        self.draw_tracks(image, ("id", "class"))
        return cv2.imencode(".png", image)[1].tobytes()


class Step(Protocol):
    """Changes or adds to the results of one video."""

    def apply(self, result: FrameResult) -> FrameResult:
        """Return the result for the next step and the sinks.

        It is called in the order of the frames. Use `dataclasses.replace` to change a result.
        """


@runtime_checkable
class ParallelStep(Step, Protocol):
    """A step with a part that needs only one frame, and can run in threads."""

    def prepare(self, frame: Frame) -> None:
        """Do that part; several threads call this at once, before `apply` for the same frame."""


@runtime_checkable
class FindingStep(Step, Protocol):
    """A step that reports facts about the whole video."""

    def finish(self) -> Facts:
        """Return the facts, after the last frame; sinks find them in `SinkContext.facts`."""


@dataclass(frozen=True, slots=True)
class StepContext:
    """What a step is made of.

    Attributes
    ----------
    width, height
        Size of the frames, pixels.
    video
        None for a single image.
    """

    settings: Settings
    width: int
    height: int
    video: VideoInfo | None = None


def make_steps(context: StepContext) -> list[Step]:
    """Make the steps enabled by the settings.

    Raises
    ------
    ConfigError, ImageError
        The regions or the lens do not fit the frames.
    ConfigError
        A name in `settings.steps` is unknown.
    """
    settings, width, height = context.settings, context.width, context.height
    steps: list[Step | None] = []
    conditions = None
    if context.video is not None:
        from vdet.conditions.watch import Conditions

        conditions = Conditions(settings, width)
        steps.append(ConditionStep(conditions))
        if min_score := settings.tracker.min_score_standing:
            steps.append(StandingStep(conditions, min_score, width))
    if settings.lanes.enabled:
        from vdet.lanes.road import RoadFinder

        lens, has_metres = settings.camera.lens, settings.lack_of_metres is None
        roads = RoadFinder(lens, settings.lanes, width, height, has_metres=has_metres)
        steps.append(LaneStep(roads, settings.detector.tyre_height, conditions))
    if settings.regions:
        steps.append(RegionStep(Regions(settings.regions, width, height)))
    steps += [load_plugin(STEPS, name)(context) for name in settings.steps]
    return [step for step in steps if step is not None]


class LaneStep:
    """Finds the lane, and the distance and the lane of each vehicle."""

    def __init__(
        self, roads: "RoadFinder", foot: float, conditions: "Conditions | None" = None
    ) -> None:
        self._roads, self._foot, self._conditions = roads, foot, conditions
        self._masks: dict[int, Image] = {}

    def prepare(self, frame: Frame) -> None:
        """Mark the lane markings of a frame."""
        self._masks[frame.index] = self._roads.observe(frame.picture)

    def apply(self, result: FrameResult) -> FrameResult:
        """Add the road, and the positions of the vehicles on it."""
        mask = self._masks.pop(result.frame.index)
        road = self._roads.update(mask, (track.box for track in result.tracks))
        tracks = with_positions(result.tracks, road, self._foot)
        if self._conditions:
            self._conditions.add_road(road.lane, tracks)
        return replace(result, tracks=tracks, facts={**result.facts, "lane": road})


def with_positions(tracks: Sequence[Track], road: "Road", foot: float) -> tuple[Track, ...]:
    """Return the tracks of a frame with the `distance` and the `lane` of their feet.

    Both are None without a lane, for a vehicle whose lower edge is cut off by the frame, and where
    `Road.position` has none. `foot` is how far boxes extend below the tyres, as a
    fraction of their height.
    """

    def with_position(track: Track) -> Track:
        x, y = track.foot
        tyres = x, y - foot * track.box.height
        position = None if road.cuts(track.box) else road.position(tyres)
        distance, lane = (position.distance, position.lane) if position else (None, None)
        return replace(track, distance=distance, lane=lane)

    return tuple(map(with_position, tracks))


class RegionStep:
    """Removes detections and vehicles outside the regions."""

    def __init__(self, regions: Regions) -> None:
        self._regions = regions

    def apply(self, result: FrameResult) -> FrameResult:
        """Keep the detections and vehicles whose foot is inside the regions."""
        contains, detections = self._regions.contains, result.detections
        rows = [row for row, item in enumerate(detections) if contains(item.box.foot)]
        tracks = tuple(track for track in result.tracks if contains(track.foot))
        return replace(result, detections=detections[rows], tracks=tracks)


class ConditionStep:
    """Watches for reasons to doubt the results, without changing them."""

    def __init__(self, conditions: "Conditions") -> None:
        self._conditions = conditions

    def apply(self, result: FrameResult) -> FrameResult:
        """Analyse a searched frame."""
        if result.is_cut:
            self._conditions.cut(float(result.frame.time))
        if result.searched:
            time, picture = float(result.frame.time), result.frame.picture
            self._conditions.add(time, picture, result.detections, result.tracks)
        return result

    def finish(self) -> Facts:
        """Return the findings about the video."""
        return {FINDINGS: self._conditions.findings()}


class StandingStep:
    """Hides the tracks that have not moved and are doubtful, if the camera is fixed.

    They are usually signs or buildings. A track is shown once it moves, reaches the score with a
    clear class, or stands where another vehicle drove. Two signs in three real clips score up to
    0.81 and 0.74, but their classes disagree.
    """

    def __init__(self, conditions: "Conditions", min_score: float, width: int) -> None:
        self._conditions = conditions
        self._min_score = min_score
        self._cell = _CELL * width
        self._starts: dict[int, Point] = {}
        self._shown: set[int] = set()
        self._driven: set[tuple[int, int]] = set()
        """Column and row of the cells in which a vehicle drove."""

    def apply(self, result: FrameResult) -> FrameResult:
        """Keep the tracks to show; all, if the camera moves."""
        has_one_class = result.detections.names == (UNKNOWN,)
        for track in result.tracks:
            start = self._starts.setdefault(track.id, track.foot)
            if has_moved(math.dist(start, track.foot), track.box.size):
                self._driven.add(self._cell_of(*track.foot))
                self._shown.add(track.id)
            elif track.score >= self._min_score and (has_one_class or track.class_name != UNKNOWN):
                self._shown.add(track.id)
        if self._conditions.is_moving:
            return result
        return replace(result, tracks=tuple(filter(self._is_shown, result.tracks)))

    def _is_shown(self, track: Track) -> bool:
        if track.id not in self._shown and self._was_driven(track.box):
            self._shown.add(track.id)
        return track.id in self._shown

    def _was_driven(self, box: Box) -> bool:
        """Return whether a vehicle drove in a cell of a box."""
        left, top = self._cell_of(box.x1, box.y1)
        right, bottom = self._cell_of(box.x2, box.y2)
        columns, rows = range(left, right + 1), range(top, bottom + 1)
        return any(cell in self._driven for cell in itertools.product(columns, rows))

    def _cell_of(self, x: float, y: float) -> tuple[int, int]:
        return int(x // self._cell), int(y // self._cell)
