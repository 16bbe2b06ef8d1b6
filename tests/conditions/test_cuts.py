"""Jump cuts of drawn roads, and what is none."""

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from benchmarks.zero import SIZE, cut_of, cuts_in, shot

from red_cars import NullDetector
from vdet.boxes import Box, Boxes, Image
from vdet.findings import Finding
from vdet.labels.label import SavedTracks, SourceVideo
from vdet.media import Frame, Picture
from vdet.run.loop import Pipeline
from vdet.track.track import ShotTracker, Track, timed
from vdet.traffic.crossings import link_tracks

SHOT = shot(1, 40)


@pytest.mark.parametrize("seed", range(4))
def test_a_video_that_was_put_together_is_cut_at_that_frame(seed: int) -> None:
    images, place = cut_of(seed)
    assert cuts_in(images) == [place]


def brighter(image: Image, index: int) -> Image:
    return np.asarray(np.clip(image * (1.6 if index >= 20 else 1.0), 0, 255), np.uint8)


def flash(image: Image, index: int) -> Image:
    lit = np.clip(image * 3.0 + 90, 0, 255)
    return np.asarray(lit if index in (20, 21, 22) else image, np.uint8)


def wiper(image: Image, index: int) -> Image:
    wiped, left = image.copy(), SIZE[0] - (index - 15) * 80
    if 15 <= index < 24:
        wiped[:, max(0, left - 120) : max(0, left)] = 20
    return wiped


@pytest.mark.parametrize("change", [lambda image, _: image, brighter, flash, wiper])
def test_a_change_of_the_exposure_a_flash_and_a_wiper_are_no_cuts(
    change: Callable[[Image, int], Image],
) -> None:
    assert cuts_in([change(image, index) for index, image in enumerate(SHOT)]) == []


class _Follows:
    """Gives the track 1 wherever it is asked."""

    def update(self, _: Boxes, __: float, ___: Picture | None = None) -> list[Track]:
        return [Track(1, Box(100, 100, 140, 140), 0.9, "detected")]


def test_tracks_end_at_a_cut_live_and_in_saved_tracks() -> None:
    images, place = cut_of(0)
    tracker = ShotTracker(lambda: timed(_Follows()))
    frames = (Frame(n, Fraction(n, 25), Picture(image)) for n, image in enumerate(images))
    results = list(Pipeline(NullDetector(), tracker).follow(frames))
    assert [result.frame.index for result in results if result.is_cut] == [place]
    ids = [track.id for result in results for track in result.tracks]
    assert ids == [1] * place + [2] * (len(images) - place)
    live = [result.frame_tracks for result in results]
    finding = Finding("cut", "cut", ((place / 25, place / 25),))
    saved = SavedTracks(
        {frame.index: frame.tracks for frame in live},
        times={frame.index: frame.time for frame in live},
        video=SourceVideo("a.mp4", *SIZE, findings=(finding,)),
    )
    assert [frame.is_cut for frame in saved] == [frame.is_cut for frame in live]
    assert len(link_tracks(live, *SIZE)) == 2
    assert len(link_tracks([replace(frame, is_cut=False) for frame in live], *SIZE)) == 1
