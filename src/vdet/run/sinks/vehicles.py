"""The sink `vehicles`: a record of each vehicle, as `.csv` or `.json`; `crops`: its best picture.

Times are in seconds and those of the input; pixels are those of the input frame, counted from 0.
"""

from pathlib import Path

from vdet.files import make_folder
from vdet.media.images import encode_image
from vdet.run.result import FrameResult
from vdet.run.sinks.protocol import BaseSink, BatchTotal, SinkContext, SinkKind
from vdet.traffic.overview import BestCrops, Crop
from vdet.traffic.records import VehicleRecords, join_records, write_records
from vdet.traffic.tables import SUFFIXES


class VehicleSink(BaseSink):
    """Keeps a record of each vehicle, and writes all at the end."""

    def __init__(self, path: Path, context: SinkContext) -> None:
        super().__init__(path, context)
        self._records = VehicleRecords(self.video.width)

    def finish(self) -> None:
        """Write the records."""
        write_records(self._records.end(), self.context.files.stage(self.path))

    def write(self, result: FrameResult) -> None:
        """Add a frame."""
        self._records.add(result.frame_tracks)


VEHICLES = SinkKind(
    VehicleSink,
    SUFFIXES,
    "records of vehicles",
    takes="videos",
    total=BatchTotal("all", join_records),
)

PATTERN = "vehicle-*-at-*s.*"


class CropSink(BaseSink):
    """Writes the picture of a vehicle when it is gone, again where a better one follows."""

    def __init__(self, path: Path, context: SinkContext) -> None:
        super().__init__(path, context)
        make_folder(path)
        self._folder = context.files.stage_folder(path, PATTERN)
        self._suffix = f".{context.settings.crops.format}"
        self._best = BestCrops()
        self._written: dict[int, Path] = {}

    def finish(self) -> None:
        """Write the pictures of the vehicles that are still shown."""
        self._write_all(self._best.end())

    def write(self, result: FrameResult) -> None:
        """Look for better pictures in a frame."""
        self._write_all(self._best.add(result.frame_tracks, result.frame.picture))

    def _write_all(self, crops: list[Crop]) -> None:
        for crop in crops:
            if crop.id in self._written:
                self._written[crop.id].unlink()
            name = f"vehicle-{crop.id:04d}-at-{crop.time:.3f}s{self._suffix}"
            self._written[crop.id] = path = self._folder / name
            path.write_bytes(encode_image(crop.image, path))


CROPS = SinkKind(CropSink, what="pictures of vehicles", marker=PATTERN, takes="videos")
