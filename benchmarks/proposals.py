"""Lines that are proposed for drawn pole cameras, compared with the streams of their traffic.

    python -m benchmarks.proposals               # from the true boxes of the thirty scenes
    python -m benchmarks.proposals found         # from what the default detector finds in them

A stream is the trips of vehicles from one line of the scene to another, of those that can be
followed. It has a line where a proposed one counts at least 70 % of its vehicles in one direction,
and they are most of those that this direction counts. A line is useless where it is for no stream,
or for one that has a line.
"""

import math
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from benchmarks.pole_cameras import HEIGHT, WIDTH, PoleScene, detected, pole_scenes
from vdet.config.schema import Settings
from vdet.config.shapes import LineSettings, TrafficSettings
from vdet.detect.factory import load_detector
from vdet.track.track import FrameTracks
from vdet.traffic.counting import count_frames
from vdet.traffic.linking import link_tracks
from vdet.traffic.proposals import propose_lines

LARGE = 0.08
"""Fraction of the vehicles from which a stream should have a line."""
MIN_VEHICLES = 5
MIN_OWN, MIN_ALL = 0.7, 0.5
LENGTHS = 1.5
"""Way of a vehicle that can be followed, in heights of its largest box."""


@dataclass(frozen=True)
class Proposed:
    """Numbers of streams, of those with a line, of lines, and of useless ones."""

    streams: int
    found: int
    lines: int
    useless: int


def proposed(scene: PoleScene, found: Sequence[FrameTracks] = ()) -> Proposed:
    """Compare the lines proposed from what was found, else from the truth, with the streams."""
    frames = list(scene.true_tracks())
    paths = link_tracks(frames, WIDTH, HEIGHT)
    lines = propose_lines(link_tracks(found or frames, WIDTH, HEIGHT), WIDTH, HEIGHT)
    size = Counter(
        scene.trips[path.tracks[0][1]].flow
        for path in paths
        if math.dist(path.points[0], path.points[path.seen - 1]) >= LENGTHS * path.heights.max()
    )
    large = {flow for flow, n in size.items() if n >= max(MIN_VEHICLES, LARGE * size.total())}
    settings = Settings(
        traffic=TrafficSettings(
            lines=tuple(
                LineSettings(
                    name=line.name,
                    start=(line.start[0] / WIDTH, line.start[1] / HEIGHT),
                    end=(line.end[0] / WIDTH, line.end[1] / HEIGHT),
                )
                for line in lines
            )
        )
    )
    used: set[tuple[str, str]] = set()
    useless = 0
    events = count_frames(frames, settings, (WIDTH, HEIGHT)).events if lines else ()
    for line in lines:
        counted = Counter(
            scene.trips[event.id].flow
            for event in events
            if (event.name, event.direction) == (line.name, "left")
        )
        flow, most = next(iter(counted.most_common(1)), (None, 0))
        fits = flow and most >= MIN_OWN * size[flow] and most >= MIN_ALL * counted.total()
        if flow is None or not fits or flow in used:
            useless += 1
        else:
            used.add(flow)
    return Proposed(len(large), len(used & large), len(lines), useless)


def main() -> None:
    """Print a row for each scene, and the fractions of all."""
    rows = []
    model = load_detector(Settings().detector) if sys.argv[1:] == ["found"] else None
    for scene in pole_scenes():
        rows.append(proposed(scene, detected(scene, model) if model else ()))
        print(scene.name, "|", rows[-1], flush=True)
    streams, found = sum(row.streams for row in rows), sum(row.found for row in rows)
    lines, useless = sum(row.lines for row in rows), sum(row.useless for row in rows)
    print(
        f"{found / streams:.0%} of {streams} streams have a line; "
        f"{useless / lines:.0%} of {lines} lines are useless"
    )


if __name__ == "__main__":
    main()
