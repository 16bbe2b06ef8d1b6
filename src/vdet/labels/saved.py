"""The tracks of a video as a file has them: the value that every reader returns."""

import math
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from vdet.boxes import Box
from vdet.detect.classes import our_name
from vdet.labels.rows import Row
from vdet.track.track import FrameTracks, Track


@dataclass(frozen=True, slots=True)
class SavedTracks:
    """The tracks of a video, read from a file.

    Attributes
    ----------
    rows
        The boxes, exactly as in the file.
    listed
        The frames that the file lists, also those without a box, counted from 0, ascending; empty
        where it lists only boxes.
    times
        Seconds of each frame that the file has a time for; empty where the format has no times.
    size
        Width and height of the frames in pixels; None where the file does not say.
    """

    rows: tuple[Row, ...]
    listed: tuple[int, ...] = ()
    times: Mapping[int, float] = field(default_factory=dict)
    size: tuple[int, int] | None = None

    @property
    def frame_count(self) -> int | None:
        """Number of frames of the video up to the last one listed; None if none is."""
        return self.listed[-1] + 1 if self.listed else None

    @property
    def rate(self) -> float | None:
        """Frames per second from the first time to the last; None if the file does not say."""
        if not self.times:
            return None
        first, last = min(self.times), max(self.times)
        seconds = self.times[last] - self.times[first]
        return (last - first) / seconds if seconds > 0 else None

    @property
    def has_times(self) -> bool:
        """Whether every frame has a time; if not, give a rate to `at_rate`."""
        return all(index in self.times for index in self._indices())

    def at_rate(self, rate: float) -> "SavedTracks":
        """Return the same tracks; frames without a time get that of `rate` frames per second."""
        times = {index: index / rate for index in self._indices()}
        return replace(self, times=times | dict(self.times))

    @property
    def frames(self) -> tuple[FrameTracks, ...]:
        """The frames with a box and those that are listed, in order, made anew at each call.

        Boxes are rounded to whole pixels, and scores lie between 0 and 1. A class is one of
        `OUR_NAMES` where the label means one, else the label. The time of a frame is NaN where it
        is not known: see `has_times`.
        """
        by_frame: dict[int, list[Row]] = defaultdict(list)
        for row in self.rows:
            by_frame[row.frame - 1].append(row)
        return tuple(
            FrameTracks(
                index,
                self.times.get(index, math.nan),
                tuple(_track(row) for row in sorted(by_frame[index], key=lambda row: row.id)),
            )
            for index in self._indices()
        )

    def _indices(self) -> list[int]:
        return sorted({row.frame - 1 for row in self.rows}.union(self.listed))


def _track(row: Row) -> Track:
    x, y = round(row.x), round(row.y)
    far = round(row.x + row.width), round(row.y + row.height)
    box = Box(x, y, max(1, far[0] - x), max(1, far[1] - y))
    name = None if row.label is None else our_name(row.label) or row.label
    score = min(1.0, max(0.0, row.score))
    return Track(row.id, box, score, row.predicted, name, row.foot, row.distance, row.lane)
