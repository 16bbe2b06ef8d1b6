"""What counts vehicles and measures their speeds while a video is processed."""

from vdet.config.schema import Settings
from vdet.lanes.ground import ground_of
from vdet.track.track import FrameTracks
from vdet.traffic.counter import VehicleCounter
from vdet.traffic.counts import Counts
from vdet.traffic.speeds import SpeedMeter, with_speeds


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

    def __init__(self, settings: Settings, width: int, height: int) -> None:
        counts, ground = settings.traffic, ground_of(settings.camera, width, height)
        self.counter = VehicleCounter(counts, width, height) if counts else None
        self.speeds = SpeedMeter(ground, width, height) if ground else None

    def add(self, frame: FrameTracks) -> None:
        """Add the tracks of the next frame."""
        for reader in (self.counter and self.counter.update, self.speeds and self.speeds.add):
            if reader:
                reader(frame)

    def counts(self) -> Counts | None:
        """Return all counts, with the speeds that are known; the video has ended."""
        return with_speeds(self.counter.counts(), self.speeds) if self.counter else None
