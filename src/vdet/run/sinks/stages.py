"""The sink `stages`: a folder with a picture of every stage of one frame."""

from pathlib import Path

from vdet.draw.boxes import WHITE, color_of, draw_box, draw_label, draw_regions
from vdet.files import make_folder
from vdet.lanes.drawing import stage_pictures
from vdet.media.images import Image, encode_image
from vdet.regions import Regions
from vdet.run.result import FrameResult
from vdet.run.sinks.overlay import PICTURE_LABEL, label_text
from vdet.run.sinks.protocol import BaseSink, SinkContext, SinkKind

_BOXES = "boxes"


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
        make_folder(self.path)
        pictures = self.context.stage_pictures(result.frame.image, result.detections)
        if settings := self.context.settings.regions:
            height, width = result.frame.image.shape[:2]
            regions = Regions(settings, width, height)
            pictures["regions"] = draw_regions(result.frame.image, regions)
        pictures[_BOXES] = _with_boxes(result)
        if result.road:
            pictures |= stage_pictures(result.road)
        for number, (name, picture) in enumerate(pictures.items(), start=1):
            path = self.path / f"{number}-{name}.png"
            self.context.files.stage(path).write_bytes(encode_image(picture, path))


def _with_boxes(result: FrameResult) -> Image:
    """Draw the detections in white with their scores, and the shown vehicles over them."""
    picture = result.frame.image.copy()
    detections = result.detections
    for each in detections:
        draw_box(picture, each.box, WHITE)
        draw_label(picture, f"{each.score:.2f}", (each.box.x1, each.box.y2), WHITE)
    for track in result.tracks:
        text = label_text(track, PICTURE_LABEL)
        draw_box(picture, track.box, color_of(track.id), text, dashed=track.predicted)
    return picture


STAGES = SinkKind(StagesSink, what="stages", marker=f"*-{_BOXES}.png", one_frame=True)
