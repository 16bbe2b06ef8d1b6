"""The distance and the lane of each shown vehicle, from the road in its frame."""

from collections.abc import Sequence
from dataclasses import replace

from vdet.lanes.road import Road
from vdet.track.track import Track


def with_positions(tracks: Sequence[Track], road: Road | None, foot: float) -> tuple[Track, ...]:
    """Return the tracks of a frame with `distance` and `lane`, None where they are not known.

    They are those of the track's foot. They are not known without a lane, of a vehicle whose lower
    edge the frame's edge cuts, and where `Road.position` does not know them.

    `foot` is how far boxes end below the tyres, share of their height.
    """
    return tuple(_with_position(track, road, foot) for track in tracks) if road else tuple(tracks)


def _with_position(track: Track, road: Road, foot: float) -> Track:
    x, y = track.foot
    tyres = x, y - foot * track.box.height
    position = None if road.cuts(track.box) else road.position(tyres)
    if position is None:
        return replace(track, distance=None, lane=None)
    return replace(track, distance=position.distance, lane=position.lane)
