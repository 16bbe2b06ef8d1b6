"""The sink `page`: a folder with the page of a video."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from vdet.config.rendering import render
from vdet.media import Picture
from vdet.media.images import is_picture_name
from vdet.pages.render import PAGE_NAME, jpeg_uri, link_to, write_page
from vdet.pages.video import Player, VideoPage, write_index
from vdet.run.result import FrameResult
from vdet.run.sinks.protocol import BaseSink, BatchTotal, SinkContext, SinkKind
from vdet.traffic.counter import VehicleCounter
from vdet.traffic.counts import MinuteCount
from vdet.traffic.overview import BestCrops, Crop, HeatMap, Levels
from vdet.traffic.records import VehicleRecords

_THUMBNAIL = 200  # longer side of the picture of a vehicle, pixels


class PageSink(BaseSink):
    """Collects what the page shows, and writes it at the end."""

    def __init__(self, path: Path, context: SinkContext) -> None:
        super().__init__(path, context)
        self._file = context.files.stage_folder(path) / PAGE_NAME
        video = self.video
        self._records = VehicleRecords(video.width)
        self._crops = BestCrops()
        self._heat = HeatMap(video.width, video.height)
        self._levels = Levels()
        self._thumbnails: dict[int, tuple[float, str]] = {}
        self._counter: VehicleCounter | None = None
        self._fullest: Picture | None = None
        self._frames = 0
        self._start = self._last = float(video.start)

    def finish(self) -> None:
        """Write the page."""
        self._keep(self._crops.end())
        write_page(self._page().html(), self._file)

    def write(self, result: FrameResult) -> None:
        """Add a frame."""
        frame, picture = result.frame_tracks, result.frame.picture
        if not self._frames:
            self._start = frame.time
        self._frames += 1
        self._last = frame.time
        if self._fullest is None or len(frame.tracks) > self._levels.most:
            self._fullest = picture
        self._records.add(frame)
        self._levels.add(frame)
        self._heat.add(frame)
        self._counter = result.counter
        self._keep(self._crops.add(frame, picture))

    def _keep(self, crops: list[Crop]) -> None:
        for crop in crops:
            self._thumbnails[crop.id] = crop.time, jpeg_uri(crop.image, _THUMBNAIL)

    def _page(self) -> VideoPage:
        return VideoPage(
            video=self.video,
            frames=self._frames,
            start=self._start,
            end=self._last + float(1 / self.video.rate),
            records=self._records.end(),
            thumbnails=self._thumbnails,
            levels=self._levels,
            still=self._heat.over(self._fullest.image) if self._fullest else None,
            player=self._player(),
            settings=render(self.context.settings),
            counts=_by_minute(self._counter.counts().minutes) if self._counter else {},
        )

    def _player(self) -> Player | None:
        """Return the video that this run writes; else the source, if it is a video file."""
        source = self.video.path
        drawn = [each.path for each in self.context.outputs if each.sink == "video"]
        if not drawn and (not source.is_file() or is_picture_name(source)):
            return None
        path, start = (drawn[0], self._start) if drawn else (source, float(self.video.start))
        return Player(path.name, link_to(path, self.path), bool(drawn), start)


def _by_minute(counts: Sequence[MinuteCount]) -> dict[str, Counter[int]]:
    """Return the counts of each line or zone and direction by minute."""
    minutes: dict[str, Counter[int]] = {}
    for each in counts:
        name = f"{each.name}: {each.direction}"
        minutes.setdefault(name, Counter())[each.minute] = each.count
    return minutes


PAGE = SinkKind(
    PageSink,
    what="pages",
    marker=PAGE_NAME,
    takes="videos",
    total=BatchTotal("index", write_index, suffix=".html"),
)
