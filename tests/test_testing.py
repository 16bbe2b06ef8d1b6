"""The checks of `vdet.testing`: ours pass them, and what is wrong is found."""

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial
from itertools import count
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from boxing import rounded
from red_cars import PERSPECTIVE, SETTINGS, drive, red_finder
from vdet.api import Tracker
from vdet.boxes import Boxes
from vdet.config.kinds import RulesTrackerSettings
from vdet.config.loading import load_settings
from vdet.config.schema import MotionTrackerSettings, Settings
from vdet.detect.svm.detector import SvmModel
from vdet.media import Picture
from vdet.run.sinks.protocol import SinkContext, SinkKind, sink_kind
from vdet.testing import check_detector, check_sink, check_tracker
from vdet.track.track import Track

IMAGES = [frame.image for frame in drive(6)]


@pytest.mark.parametrize("settings", [SETTINGS, PERSPECTIVE], ids=["outlines", "votes"])
def test_the_linear_model_passes(settings: Settings) -> None:
    check_detector(SvmModel(red_finder(), settings.svm), IMAGES)


@pytest.mark.parametrize(
    "settings", [MotionTrackerSettings(), RulesTrackerSettings()], ids=["motion", "rules"]
)
def test_both_trackers_pass(settings: MotionTrackerSettings | RulesTrackerSettings) -> None:
    check_tracker(lambda width, height: Tracker(width, height, Settings(tracker=settings)))


@pytest.mark.parametrize(
    "output",
    [
        *("video=out.mp4", "tracks=out.csv", "stages=stages", "image=out.png", "json=out.json"),
        *("vehicles=out.json", "crops=crops", "page=page", "counts=out.csv", "counts=out.json"),
    ],
)
def test_every_sink_passes(output: str, tmp_path: Path) -> None:
    name, _, file = output.partition("=")
    lines = ["traffic.lines=[{name: a, start: [0, 0.5], end: [1, 1]}]"]
    settings = load_settings((), lines if name == "counts" else [])
    check_sink(sink_kind(name), tmp_path / file, settings, still=name == "image")


@dataclass(frozen=True)
class Finder:
    """A detector that finds one box, unless it searches or detects in another way."""

    search: Callable[[Picture, int | None], Any] = lambda *_: None
    detect: Callable[[Any], Boxes] = lambda _: Boxes([[1, 1, 9, 9]], [0.5])

    def for_video(self, *_: object) -> "Finder":
        return self


def paint(picture: Picture, _: int | None) -> None:
    picture.image[:] = 0


NUMBERS = count(9)


@pytest.mark.parametrize(
    ("detector", "message"),
    [
        (Finder(search=paint), "changed a frame"),
        (Finder(detect=lambda _: Boxes([[-5, 1, 9, 9]], [0.5])), "lies outside the frame"),
        (Finder(detect=lambda _: Boxes([[1, 1, next(NUMBERS), 9]], [0.5])), "boxes differ"),
    ],
)
def test_a_detector_that_breaks_a_rule_is_found(detector: Finder, message: str) -> None:
    check_detector(Finder(), IMAGES)
    with pytest.raises(AssertionError, match=message):
        check_detector(detector, [image.copy() for image in IMAGES])


class Shares:
    """A tracker whose ids go on from one video to the next."""

    ids = count(1)

    def __init__(self) -> None:
        self.own = [next(self.ids), next(self.ids)]

    def update(self, detections: Boxes, _: float, __: Picture | None = None) -> list[Track]:
        pairs = zip(self.own, rounded(detections), strict=False)
        return [Track(number, box, 0.5, state="detected") for number, box in pairs]


class Forgets(Shares):
    """A tracker that gives new ids in every frame."""

    def update(self, detections: Boxes, time: float, picture: Picture | None = None) -> list[Track]:
        first = 1 + 2 * round(time * 25)
        tracks = super().update(detections, time, picture)
        return [replace(track, id=first + number) for number, track in enumerate(tracks)]


@pytest.mark.parametrize(
    ("tracker", "message"), [(Shares, "share something"), (Forgets, "changed its id")]
)
def test_a_tracker_that_breaks_a_rule_is_found(tracker: type[Shares], message: str) -> None:
    with pytest.raises(AssertionError, match=message):
        check_tracker(lambda *_: tracker())


def sink_that(writes: Callable[[Path, Any], object]) -> SinkKind:
    """Return a sink that does this with its final path and each result."""

    def opened(path: Path, _: SinkContext) -> Any:
        return nullcontext(SimpleNamespace(write=partial(writes, path)))

    return SinkKind(opened)


@pytest.mark.parametrize(
    ("sink", "message"),
    [
        (sink_that(lambda path, _: path.touch()), "before the run has ended"),
        (sink_that(lambda _, result: result.frame.image.fill(0)), "changed the frame"),
        (sink_that(lambda *_: None), "left no output"),
    ],
)
def test_a_sink_that_breaks_a_rule_is_found(sink: SinkKind, message: str, tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match=message):
        check_sink(sink, tmp_path / "out.txt")
