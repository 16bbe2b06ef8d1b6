"""The result of one frame, and what steps find out beside its tracks."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol, cast

import cv2

from vdet.boxes import Boxes
from vdet.conditions.finding import Findings
from vdet.detect.classes import is_chosen
from vdet.draw.boxes import color_of, draw_box
from vdet.lanes.road import Road
from vdet.media import Frame
from vdet.track.track import FrameTracks, Track


class Fact(Protocol):
    """What a step finds out of a frame or of a whole video: a frozen value of a type of its own.

    Each line of `str` of a fact about a whole video is a warning for people; empty for none.
    """

    def record(self) -> Any:
        """Return it as values for JSON."""


Facts = Mapping[str, Fact]
"""Facts by their names, which are their keys in JSON."""

CONDITIONS = "conditions"
"""Name of the fact about a video that says what makes its results doubtful."""


def findings_in(facts: Facts) -> Findings:
    """Return what makes the results of a video doubtful."""
    return cast("Findings", facts.get(CONDITIONS, Findings()))


@dataclass(frozen=True, slots=True)
class FrameResult:
    """A frame, what was detected in it, the vehicles that are shown, and facts about it.

    Attributes
    ----------
    source
        The video, or the still picture.
    frame
        The frame as it was read. All sinks get the same image, so none may change it.
    detections, tracks
        In pixels of that frame.
    facts
        What steps found out of it; the lane is "lane".
    searched
        Whether the detector searched the frame: see `detector.stride`. Where it did not, there are
        no detections.
    """

    source: Path
    frame: Frame
    detections: Boxes
    tracks: tuple[Track, ...]
    facts: Facts = field(default_factory=dict)
    searched: bool = True

    @property
    def road(self) -> Road | None:
        """The lane; None if lanes are not looked for."""
        return cast("Road | None", self.facts.get("lane"))

    @property
    def frame_tracks(self) -> FrameTracks:
        """The tracks with the number and the time of the frame, and its facts."""
        facts = {name: fact.record() for name, fact in self.facts.items()}
        return FrameTracks(self.frame.index, float(self.frame.time), self.tracks, facts)

    def of_classes(self, classes: Collection[str]) -> "FrameResult":
        """Return the result with only the tracks of some classes; none means all."""
        chosen = (track for track in self.tracks if is_chosen(track.class_name, classes))
        return replace(self, tracks=tuple(chosen)) if classes else self

    def _repr_png_(self) -> bytes:
        """Return the frame with its vehicles, which notebooks show."""
        image = self.frame.image.copy()
        for track in self.tracks:
            label = f"#{track.id} {track.class_name or ''}".rstrip()
            draw_box(image, track.box, color_of(track.id), label, dashed=track.state == "predicted")
        return cv2.imencode(".png", image)[1].tobytes()
