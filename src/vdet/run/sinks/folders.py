"""The sinks that fill a folder with pictures: `stages` of one frame, and `crops` of vehicles."""

import re
from pathlib import Path

from vdet.draw.boxes import WHITE, color_of, draw_box, draw_label, draw_regions
from vdet.lanes.drawing import stage_pictures
from vdet.media.images import Image, encode_image
from vdet.regions import Regions
from vdet.run.result import FrameResult
from vdet.run.sinks.drawn import PICTURE_LABEL, VIDEO_LABEL, label_text
from vdet.run.sinks.protocol import BaseSink, SinkContext, SinkKind
from vdet.traffic.overview import BestCrops, Crop

_BOXES = "boxes"
_CROP_NAME = re.compile(r"vehicle-\d{4,}-at-\d+\.\d{3}s\.(jpg|png)")


class StagesSink(BaseSink):
    """Writes the pictures of the first searched frame at or after the time `SinkContext.at`."""

    def __init__(self, path: Path, context: SinkContext) -> None:
        super().__init__(path, context)
        start = context.video.start if context.video else 0
        self._time = start + context.at
        self._is_done = False

    def write(self, result: FrameResult) -> None:
        """Write the pictures if it is the frame."""
        if self._is_done or not result.searched or result.frame.time < self._time:
            return
        self._is_done = True
        pictures = self.context.stage_pictures(result.frame.image, result.detections)
        if settings := self.context.settings.regions:
            height, width = result.frame.image.shape[:2]
            regions = Regions(settings, width, height)
            pictures["regions"] = draw_regions(result.frame.image, regions)
        pictures[_BOXES] = _with_boxes(result, is_still=self.context.video is None)
        if result.road:
            pictures |= stage_pictures(result.road)
        folder = self.context.files.stage_folder(self.path)
        for number, (name, picture) in enumerate(pictures.items(), start=1):
            path = folder / f"{number}-{name}.png"
            path.write_bytes(encode_image(picture, path))


def _with_boxes(result: FrameResult, *, is_still: bool) -> Image:
    """Draw the detections in white with their scores, and the shown vehicles over them."""
    picture = result.frame.image.copy()
    detections = result.detections
    for each in detections:
        draw_box(picture, each.box, WHITE)
        draw_label(picture, f"{each.score:.2f}", (each.box.x1, each.box.y2), WHITE)
    for track in result.tracks:
        text = label_text(track, PICTURE_LABEL if is_still else (*VIDEO_LABEL, *PICTURE_LABEL))
        draw_box(picture, track.box, color_of(track.id), text, dashed=track.state == "lost")
    return picture


STAGES = SinkKind(StagesSink, what="stages", marker=f"*-{_BOXES}.png", one_frame=True)


class CropSink(BaseSink):
    """Writes the picture of a vehicle when it is gone, again where a better one follows."""

    def __init__(self, path: Path, context: SinkContext) -> None:
        super().__init__(path, context)
        self._folder = context.files.stage_folder(path, _CROP_NAME)
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
            name = f"vehicle-{crop.id:04d}-at-{crop.time:.3f}s.jpg"
            self._written[crop.id] = path = self._folder / name
            path.write_bytes(encode_image(crop.image, path))


CROPS = SinkKind(CropSink, what="pictures of vehicles", marker="vehicle-*-at-*s.*", takes="videos")
