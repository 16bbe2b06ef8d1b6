"""What commands need that look at a whole clip: one of its frames, and its vehicles."""

import math
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from vdet.cli import options
from vdet.cli.messages import progress_steps

if TYPE_CHECKING:
    from fractions import Fraction

    from vdet.boxes import Image
    from vdet.config.schema import Settings
    from vdet.traffic.records import VehicleRecord


@dataclass(frozen=True, slots=True)
class Watched:
    """The values of `watch_options`: a clip, and where the tracks of its vehicles are."""

    tracks: Path | None
    start: "Fraction | None"
    end: "Fraction | None"

    def first_image(self, clip: Path, settings: "Settings") -> "Image":
        """Return the first frame, BGR uint8 `(H, W, 3)`; a picture itself.

        Raises
        ------
        ImageError, VideoError
            The clip cannot be read, or has no frame at `start`.
        """
        from vdet.errors import VideoError
        from vdet.media.images import is_picture_name, read_image
        from vdet.media.reader import VideoReader

        if is_picture_name(clip) and "%" not in clip.name:
            return read_image(clip)
        with VideoReader(clip, start=self.start, settings=settings.input) as reader:
            for frame in reader:
                return frame.image
        raise VideoError(f"{clip}: has no frame at {float(self.start or 0):.2f} s; check --start")

    def records(self, clip: Path, width: int, settings: "Settings") -> "tuple[VehicleRecord, ...]":
        """Return the records of the vehicles: from the file of tracks, else the clip is searched.

        `width` is that of the frames, pixels.

        Raises
        ------
        VdetError
            The tracks or the clip cannot be used.
        """
        from vdet.detect.factory import load_detector
        from vdet.labels.reading import read_tracks
        from vdet.media.reader import VideoReader
        from vdet.run.video import Run, open_video
        from vdet.traffic.records import VehicleRecords

        records = VehicleRecords(width)
        if self.tracks is not None:
            rate, zero = 1.0, 0.0
            if self.start is not None or self.end is not None:
                with VideoReader(clip, settings=settings.input) as reader:
                    rate, zero = float(reader.info.rate), float(reader.info.start)
            end = math.inf if self.end is None else zero + self.end
            for frame in read_tracks(self.tracks, rate):
                if zero + (self.start or 0) <= frame.time < end:
                    records.add(frame)
            return records.end()
        run = Run(clip, (), settings, self.start, self.end)
        model = load_detector(settings.detector)
        with progress_steps(" frames") as steps, open_video(run, model) as video:
            advance = partial(steps, "")(video.reader.expected)
            for result in video.results:
                records.add(result.frame_tracks)
                advance(1)
        return records.end()


_tracks = options.option(
    "--tracks-from FILE", "Take the vehicles from this file of tracks.", name="tracks"
)
watch_options = options.bundle(
    "watched", Watched, _tracks, options.start_option, options.end_option
)
"""`--tracks-from FILE`, `--start` and `--end`."""
