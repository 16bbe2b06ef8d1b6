"""The sink `page`: a folder with the page of a video."""

import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Self

import av
import cv2
import numpy as np

from vdet.config.rendering import render
from vdet.files import make_folder
from vdet.media.images import Image, is_picture_name
from vdet.pages.charts import Series
from vdet.pages.index import write_index
from vdet.pages.render import PAGE_NAME, jpeg_uri, write_page
from vdet.pages.video import Player, Thumbnail, VideoPage
from vdet.run.result import FrameResult
from vdet.run.sinks.protocol import BatchTotal, SinkContext, SinkKind
from vdet.traffic.counter import VehicleCounter
from vdet.traffic.crops import BestCrops, Crop
from vdet.traffic.events import Event
from vdet.traffic.heat import HeatMap
from vdet.traffic.levels import Levels
from vdet.traffic.records import VehicleRecords
from vdet.traffic.totals import by_minute
from vdet.version import __version__

_EVEN = 6.0  # standard deviation of a frame that shows nothing, such as one that is faded in
_STILL = 960
"""Largest width of the still under the heat, pixels."""
_THUMBNAIL = 200
"""Longer side of the picture of a vehicle, pixels."""
_MOST_VEHICLES = 300
"""Most vehicles that are shown one by one: those that are in view longest."""
_QUALITY = 80  # of the pictures of vehicles, JPEG


class PageSink:
    """Collects what the page shows, and writes it at the end."""

    def __init__(self, path: Path, context: SinkContext) -> None:
        assert context.video is not None  # `takes` says so
        make_folder(path)
        self._folder = path
        self._context = context
        self._video = video = context.video
        settings = context.settings
        self._records = VehicleRecords(video.width)
        self._crops = BestCrops(settings.crops)
        self._heat = HeatMap(video.width, video.height)
        self._levels = Levels()
        self._thumbnails: dict[int, Thumbnail] = {}
        self._counter: VehicleCounter | None = None
        self._still: Image | None = None
        self._is_even = True
        self._frames = 0
        self._start = self._last = float(video.start)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: Any, *_: object) -> None:
        if kind is None:
            self._keep(self._crops.end())
            target = self._context.files.stage(self._folder / PAGE_NAME)
            write_page(self._page().html(), target)

    def write(self, result: FrameResult) -> None:
        """Add a frame."""
        frame, picture = result.frame_tracks, result.frame.picture
        if not self._frames:
            self._start = frame.time
        self._frames += 1
        self._last = frame.time
        if self._still is None or self._is_even:
            self._still = _at_most(picture.image, _STILL, picture.width)
            self._is_even = float(self._still.std()) < _EVEN
        self._records.add(frame)
        self._levels.add(frame)
        self._heat.add(frame)
        self._counter = result.counter
        self._keep(self._crops.add(frame, picture))

    def _keep(self, crops: list[Crop]) -> None:
        for crop in crops:
            small = _at_most(crop.image, _THUMBNAIL, max(crop.image.shape[:2]))
            self._thumbnails[crop.id] = Thumbnail(crop.time, jpeg_uri(small, _QUALITY))

    def _page(self) -> VideoPage:
        return VideoPage(
            source=self._video.path,
            width=self._video.width,
            height=self._video.height,
            frames=self._frames,
            start=self._start,
            end=self._last + float(1 / self._video.rate),
            records=self._records.end(),
            thumbnails=self._thumbnails,
            levels=self._levels,
            still=None if self._still is None else self._heat.over(self._still),
            player=self._player(),
            most_vehicles=_MOST_VEHICLES,
            settings=render(self._context.settings),
            versions=_versions(),
            counts=_series(self._counter.finish()) if self._counter else (),
        )

    def _player(self) -> Player | None:
        """Return the video that this run writes; else the source, if it is a video file."""
        for output in self._context.outputs:
            if output.sink == "video":
                return Player.of(output.path, self._folder, is_drawn=True, start=self._start)
        source = self._video.path
        if source.is_file() and not is_picture_name(source):
            start = float(self._video.start)
            return Player.of(source, self._folder, is_drawn=False, start=start)
        return None


def _at_most(image: Image, most: int, side: int) -> Image:
    """Return a copy that is scaled down so that a side of `side` pixels has at most `most`."""
    if side <= most:
        return image.copy()
    height, width = (max(1, round(each * most / side)) for each in image.shape[:2])
    return np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA), np.uint8)


def _series(events: Sequence[Event]) -> list[Series]:
    """Return the counts of each line or zone and direction by minute."""
    minutes: dict[tuple[str, str], dict[int, int]] = {}
    for each in by_minute(events):
        minutes.setdefault((each.name, each.direction), {})[each.minute] = each.count
    return [Series(": ".join(key), counts) for key, counts in minutes.items()]


def _versions() -> dict[str, str]:
    return {
        "vdet": __version__,
        "Python": platform.python_version(),
        "OpenCV": cv2.__version__,
        "NumPy": np.__version__,
        "PyAV": av.__version__,
    }


PAGE = SinkKind(
    PageSink,
    what="pages",
    marker=PAGE_NAME,
    takes="videos",
    total=BatchTotal("index", write_index, suffix=".html"),
)
