"""Traces on the drawn pole cameras, if some of the true tracks are taken away.

    python -m benchmarks.traces          # all thirty scenes
    python -m benchmarks.traces 6        # every sixth

A tenth of the tracks that cross a line is taken away at random, with five seeds. A crossing of
these is found if it has a trace; every other trace is false.
"""

import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from benchmarks.drawn_traffic import as_planes
from benchmarks.pole_cameras import HEIGHT, WIDTH, PoleScene, pole_scenes
from vdet.boxes import Image
from vdet.review.strips import Band, BandPassage, Passages, TraceSearch, bands_of, sampling_of
from vdet.synthetic import frames
from vdet.track.track import FrameTracks
from vdet.traffic.counts import Trace
from vdet.traffic.crossings import lines_and_zones

MISSED = 0.1
SEEDS = range(5)
SECONDS, PLACE = 0.8, 0.15
"""Maximum seconds, and fraction of the line, from a trace to the crossing that it shows."""


@dataclass(frozen=True)
class Line:
    """A line of a scene: its passages, and the pixels of its band in each frame."""

    band: Band
    passages: Sequence[BandPassage]
    strip: Sequence[Image]


Outcome = Counter[str]
"""Number of crossings, of those taken away, of those that have a trace, and of false traces."""


def _text(outcome: Outcome) -> str:
    found = outcome["found"] / max(1, outcome["missed"])
    false = 100 * outcome["false"] / max(1, outcome["crossings"])
    return (
        f"{outcome['found']} of {outcome['missed']} missed have a trace ({found:.1%}); "
        f"{outcome['false']} false, {false:.1f} per 100 of {outcome['crossings']}"
    )


def lines_of(scene: PoleScene, truth: Sequence[FrameTracks]) -> list[Line]:
    """Return the lines of a scene with their strips."""
    assert scene.settings.traffic
    bands = bands_of(lines_and_zones(scene.settings.traffic, WIDTH, HEIGHT)[0])
    passing = Passages(bands)
    for frame in truth:
        passing.add(frame)
    pairs = list(zip(bands, passing.by_band, strict=True))
    samplings = [sampling_of(band, passages) for band, passages in pairs]
    strips: list[list[Image]] = [[] for _ in bands]
    for drawn in frames(scene.scene):
        layers = as_planes(drawn).picture.layers
        for strip, sampling in zip(strips, samplings, strict=True):
            strip.append(sampling.cut(layers))
    return [Line(*pair, strip) for pair, strip in zip(pairs, strips, strict=True)]


def measured(line: Line, truth: Sequence[FrameTracks], missed: set[int]) -> Outcome:
    """Return what is found at a line without some of the tracks."""
    shown = [
        replace(frame, tracks=tuple(track for track in frame.tracks if track.id not in missed))
        for frame in truth
    ]
    counted = [passage for passage in line.passages if passage.id not in missed]
    traces = TraceSearch(0, line.band).search(shown, line.strip, counted, is_end=True)
    gone = [passage for passage in line.passages if passage.id in missed]
    left = list(gone)
    for trace in traces:
        if same := min(
            (passage for passage in left if _shows(trace, passage)),
            key=lambda passage: abs(trace.time - passage.time),
            default=None,
        ):
            left.remove(same)
    found = len(gone) - len(left)
    false = len(traces) - found
    return Counter(crossings=len(line.passages), missed=len(gone), found=found, false=false)


def _shows(trace: Trace, passage: BandPassage) -> bool:
    is_near = abs(trace.time - passage.time) <= SECONDS
    return is_near and abs(trace.position - passage.position) <= PLACE


def main() -> None:
    """Measure the scenes; print a row for each, and the total."""
    step = int(sys.argv[1]) if len(sys.argv) > 1 else 1
    total = Outcome()
    for scene in islice(pole_scenes(), 0, None, step):
        truth = list(scene.true_tracks())
        lines = lines_of(scene, truth)
        ids = sorted({passage.id for line in lines for passage in line.passages})
        outcome = Outcome()
        for seed in SEEDS:
            count = max(1, round(MISSED * len(ids)))
            missed = set(np.random.default_rng(seed).choice(ids, count, replace=False).tolist())
            for line in lines:
                outcome += measured(line, truth, missed)
        print(f"{scene.name}: {_text(outcome)}", flush=True)
        total += outcome
    print(f"all: {_text(total)}")


if __name__ == "__main__":
    main()
