"""Undistorted frames → lanes."""

from dataclasses import dataclass

import numpy as np

from vdet.config.lanes import LaneSettings
from vdet.lanes.lane import Lane
from vdet.lanes.mask import lane_mask
from vdet.lanes.sighting import sight_anew, sight_around
from vdet.lanes.track import Track, follow, start
from vdet.lanes.view import View
from vdet.media.images import Image

_POINTS = 24  # of a polyline


@dataclass(frozen=True, slots=True)
class Glance:
    """What one frame shows by itself: the road from above, and where paint is on it."""

    above: Image
    """BGR uint8 `(rows, columns, 3)`."""
    mask: Image
    """uint8 `(rows, columns)`, 255 where paint is."""


class LaneFinder:
    """Finds the lane in the undistorted frames of one video, `width` × `height` pixels each.

    `glance` needs nothing of the frames before, and may be called by many threads at a time;
    `follow` takes the glances one by one, in the order of the frames.
    """

    def __init__(self, settings: LaneSettings, width: int, height: int) -> None:
        self._settings = settings
        self._track: Track | None = None
        self.view = View(settings.view, width, height)

    def glance(self, image: Image) -> Glance:
        """Return the road from above and its paint, of an undistorted BGR frame `(H, W, 3)`."""
        above = self.view.from_above(image)
        return Glance(above, lane_mask(above, self._settings.mask, self.view.across))

    def follow(self, glance: Glance) -> Lane | None:
        """Take the next frame in; return the lane, None where none is known well enough."""
        self._track = self._next(glance.mask)
        return self._lane(self._track) if self._track else None

    def find(self, image: Image) -> Lane | None:
        """Return the lane in the next undistorted frame: `glance`, then `follow`."""
        return self.follow(self.glance(image))

    def _next(self, mask: Image) -> Track | None:
        """Follow the lane; where that fails look anew, and carry it where that fails too."""
        settings, track = self._settings, self._track
        around = sight_around(mask, self.view, track.curves, settings) if track else None
        if track and around and (followed := follow(track, around, settings.track)):
            return followed
        if anew := sight_anew(mask, self.view, settings):
            return start(anew)
        return follow(track, None, settings.track) if track and not around else None

    def _lane(self, track: Track) -> Lane:
        curves, curvature = track.curves, track.curvature
        far, near = self.view.distances[[0, -1]]
        z = np.geomspace(near, far, _POINTS)
        left, right = curves.at(z)
        straight = abs(curvature) * self._settings.track.straight < 1
        return Lane(
            curvature=curvature,
            radius=None if straight else 1 / abs(curvature),
            offset=-(curves.left + curves.right) / 2,
            width=curves.width,
            left=self.view.to_frame(left, z),
            right=self.view.to_frame(right, z),
        )
