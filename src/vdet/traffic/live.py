"""What counts vehicles and measures their speeds while a video is processed."""

from typing import TYPE_CHECKING

from vdet.config.schema import Settings
from vdet.track.track import FrameTracks

if TYPE_CHECKING:  # most runs need neither
    from vdet.traffic.counter import VehicleCounter
    from vdet.traffic.counts import Counts
    from vdet.traffic.speeds import SpeedMeter


class LiveTraffic:
    """Reads the tracks of a video, frame by frame, after all steps.

    Attributes
    ----------
    counter
        None without lines and zones.
    speeds
        None without points of the ground.

    Raises
    ------
    ConfigError
        The ground does not fit the frames, `width` × `height` pixels.
    """

    counter: "VehicleCounter | None" = None
    speeds: "SpeedMeter | None" = None

    def __init__(self, settings: Settings, width: int, height: int) -> None:
        if settings.traffic:
            from vdet.traffic.counter import VehicleCounter

            self.counter = VehicleCounter(settings.traffic, width, height)
        if settings.camera.ground:
            from vdet.lanes.ground import ground_of
            from vdet.traffic.speeds import SpeedMeter

            if ground := ground_of(settings.camera, width, height):
                self.speeds = SpeedMeter(ground, width, height)

    def add(self, frame: FrameTracks) -> None:
        """Add the tracks of the next frame."""
        if self.counter:
            self.counter.update(frame)
        if self.speeds:
            self.speeds.add(frame)

    def counts(self) -> "Counts | None":
        """Return all counts so far, with the speeds that are known."""
        if self.counter is None:
            return None
        from vdet.traffic.speeds import with_speeds

        return with_speeds(self.counter.counts(), self.speeds)
