"""One lane through many frames: smoothed, carried for a while, then given up."""

from dataclasses import dataclass

from vdet.config.lanes import LaneTrackSettings
from vdet.lanes.curves import Curves
from vdet.lanes.fit import Evidence, solve
from vdet.lanes.sighting import Sighting


@dataclass(frozen=True, slots=True)
class Track:
    """What the frames up to now say about the lane."""

    curves: Curves
    evidence: Evidence
    unseen: tuple[int, int]
    """Frames since the left and the right line were seen."""
    curvature: float
    """1/m, smoothed over more frames than the curves."""


def start(sighting: Sighting) -> Track:
    """Begin with the frame that a lane is first seen in."""
    curves = sighting.curves
    return Track(curves, sighting.evidence, (0, 0), 2 * curves.bend)


def follow(track: Track, sighting: Sighting | None, settings: LaneTrackSettings) -> Track | None:
    """Take a frame in; None where the lane is lost.

    It is lost when one of its lines was not seen for more than `settings.carry` frames, or when
    the camera has left it.
    """
    seen = sighting.seen if sighting else (False, False)
    left, right = (0 if now else before + 1 for now, before in zip(seen, track.unseen, strict=True))
    curves, evidence, curvature = track.curves, track.evidence, track.curvature
    if sighting:
        evidence = sighting.evidence.with_earlier(evidence, settings.memory)
        curves = solve(evidence, curves.width)
        curvature += (1 - settings.curve_memory) * (2 * curves.bend - curvature)
    if max(left, right) > settings.carry or not curves.hold_camera:
        return None
    return Track(curves, evidence, (left, right), curvature)
