"""The road in frames as the camera delivers them: undistorted, with its lane."""

from dataclasses import dataclass

from vdet.config.lanes import LaneSettings
from vdet.geometry import Box
from vdet.lanes.camera import Camera
from vdet.lanes.drawing import lane_pictures
from vdet.lanes.finder import Glance, LaneFinder
from vdet.lanes.lane import Lane
from vdet.lanes.undistortion import Undistorter
from vdet.lanes.view import View
from vdet.media.images import Image


@dataclass(frozen=True, slots=True)
class LaneRequest:
    """Lanes are to be found; `camera` took the frames, None where they are undistorted already."""

    camera: Camera | None = None


@dataclass(frozen=True, slots=True)
class Look:
    """What one frame shows by itself."""

    image: Image
    """The undistorted frame, BGR uint8 `(H, W, 3)`; the frame itself where no camera is given."""
    glance: Glance


@dataclass(frozen=True, slots=True)
class Road:
    """The road in one frame of a video."""

    image: Image
    """As in `Look`."""
    lane: Lane | None
    """None where none is known well enough."""
    glance: Glance
    view: View
    undistorter: Undistorter | None

    def place(self, box: Box) -> Box:
        """Return where what `box` holds in the frame lies in `image`; area 0: outside it."""
        return self.undistorter.box(box) if self.undistorter else box

    def pictures(self) -> dict[str, Image]:
        """Return a picture of every stage of finding the lane, as `lane_pictures` does."""
        return lane_pictures(self.image, self.glance, self.lane, self.view)


class RoadWatch:
    """Undistorts the frames of one video and finds the lane in them.

    `look` may be called by many threads at a time; `follow` takes the looks in order.
    Raises `ConfigError` for frames of another shape than the camera's.
    """

    def __init__(
        self, request: LaneRequest, settings: LaneSettings, width: int, height: int
    ) -> None:
        camera = request.camera
        self._undistorter = Undistorter(camera, width, height) if camera else None
        self._finder = LaneFinder(settings, width, height)

    def look(self, image: Image) -> Look:
        """Undistort a frame, BGR uint8 `(H, W, 3)`, and pick out the paint on its road."""
        undistorted = self._undistorter.image(image) if self._undistorter else image
        return Look(undistorted, self._finder.glance(undistorted))

    def follow(self, look: Look) -> Road:
        """Take the next frame in."""
        lane = self._finder.follow(look.glance)
        return Road(look.image, lane, look.glance, self._finder.view, self._undistorter)
