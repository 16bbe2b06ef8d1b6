"""The sink `crops`: a folder with the best picture of each vehicle."""

from pathlib import Path
from typing import Any, Self

from vdet.files import make_folder
from vdet.media.images import encode_image
from vdet.run.result import FrameResult
from vdet.run.sinks.protocol import SinkContext, SinkKind
from vdet.traffic.crops import BestCrops, Crop

PATTERN = "vehicle-*-at-*s.*"


class CropSink:
    """Writes the picture of a vehicle when it is gone, again where a better one follows."""

    def __init__(self, path: Path, context: SinkContext) -> None:
        make_folder(path)
        self._folder = context.files.stage_folder(path, PATTERN)
        self._suffix = f".{context.settings.crops.format}"
        self._best = BestCrops(context.settings.crops)
        self._written: dict[int, Path] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: Any, *_: object) -> None:
        if kind is None:
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
