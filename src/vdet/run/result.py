"""The result of one frame, and the facts that steps add to it."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, cast

import cv2

from vdet.boxes import Boxes, Image
from vdet.config.classes import is_chosen
from vdet.draw.boxes import color_of, draw_box
from vdet.errors import ConfigError
from vdet.findings import Findings
from vdet.media import Frame
from vdet.track.track import FrameTracks, Track

if TYPE_CHECKING:  # loaded with `--lanes`
    from vdet.lanes.road import Road


class Fact(Protocol):
    """A result of a step about a frame or a whole video: a frozen value of any type.

    Each line of the `str` of a fact about a whole video is printed as a warning.
    """

    def record(self) -> Any:
        """Return it as values for JSON."""


Facts = Mapping[str, Fact]
"""Facts by their names, which are their keys in JSON."""

FINDINGS = "conditions"
"""Name of the fact that has the reasons to doubt the results of a video."""


_KEYS = {"frame", "time", "tracks", "clock", "video", "findings", "last", "image", "boxes"}
"""Keys of a record, which no fact about a frame may have."""


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
