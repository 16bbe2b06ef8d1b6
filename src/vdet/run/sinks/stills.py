"""The sinks of still pictures: `picture` (vehicles drawn in) and `json` (a list of boxes)."""

import json
from pathlib import Path
from typing import Any

from vdet.errors import OutputError
from vdet.files import print_now
from vdet.lanes.road import lane_record
from vdet.media import Picture
from vdet.media.images import PICTURE_SUFFIXES, encode_image
from vdet.run.result import FrameResult
from vdet.run.sinks.overlay import Overlay
from vdet.run.sinks.protocol import STANDARD_OUTPUT, BaseSink, SinkContext, SinkKind
from vdet.track.track import Track


class PictureSink(BaseSink):
    """Writes one picture."""

    def __init__(self, path: Path, context: SinkContext) -> None:
        super().__init__(path, context)
        self._overlay = Overlay(context.settings, None)
        self._is_done = False

    def write(self, result: FrameResult) -> None:
        """Draw the vehicles, and write the picture.

        Raises `OutputError` for a second picture.
        """
        if self._is_done:
            raise OutputError(
                f"{self.path}: takes one picture; for several give the name of a folder"
            )
        self._is_done = True
        data = encode_image(Picture(self._overlay.draw(result)).image, self.path)
        self.context.files.stage(self.path).write_bytes(data)


PICTURE = SinkKind(PictureSink, sorted(PICTURE_SUFFIXES), "pictures", takes="pictures")


class JsonSink(BaseSink):
    """Collects an item per picture, and writes the list at the end, if there is an item.

    Each item has `image`, `width`, `height` and `boxes`: a list of objects with `x`, `y`, `width`,
    `height` (pixels of the input picture) and `score`. If lanes are searched for, it also has
    `lane`, as in `.jsonl` tracks, and each box has `distance` (metres, two decimals) and `lane`, as
    in `Track`, null where they are not known.
    """

    def __init__(self, path: Path, context: SinkContext) -> None:
        super().__init__(path, context)
        self._items: list[dict[str, Any]] = []

    def finish(self) -> None:
        """Write the list."""
        if not self._items:
            return
        text = json.dumps(self._items, indent=2, allow_nan=False) + "\n"
        if self.path == STANDARD_OUTPUT:
            print_now(text)
        else:
            self.context.files.stage(self.path).write_text(text, encoding="utf-8")

    def write(self, result: FrameResult) -> None:
        """Add the item of a picture."""
        item: dict[str, Any] = {
            "image": str(result.source),
            "width": result.frame.picture.width,
            "height": result.frame.picture.height,
            "boxes": [_box(track, on_road=result.road is not None) for track in result.tracks],
        }
        if result.road:
            item["lane"] = lane_record(result.road.lane)
        self._items.append(item)


def _box(track: Track, *, on_road: bool) -> dict[str, Any]:
    """Return the values of a vehicle; with `on_road` also its place on the road."""
    values: dict[str, Any] = {
        **dict(zip(("x", "y", "width", "height"), track.box.xywh, strict=True)),
        "score": round(track.score, 4),
    }
    if on_road:
        metres = track.distance
        values["distance"] = None if metres is None else round(metres, 2)
        values["lane"] = track.lane
    return values


JSON = SinkKind(JsonSink, what="lists of boxes", writes_standard_output=True, takes="pictures")
