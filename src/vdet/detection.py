"""One frame → its windows, heat and regions: what still pictures and video have in common."""

from dataclasses import dataclass, replace

from vdet.config.scaling import scale_lengths
from vdet.config.schema import Settings
from vdet.geometry import Box
from vdet.heatmap import Heat, HeatMap, Region, find_regions
from vdet.images import Image
from vdet.model import LinearModel
from vdet.search.engine import make_search
from vdet.windows import Windows


@dataclass(frozen=True, slots=True)
class Detection:
    """What was found in a frame, before any memory of cars.

    `windows` are all searched ones, `hits` those of at least `search.probability`, `heat` is
    float32 `(H, W)`, `regions` is where it exceeds `heat.threshold`.
    """

    windows: Windows
    hits: Windows
    heat: Heat
    regions: tuple[Region, ...]


class Detector:
    """Finds regions in consecutive frames of one size.

    Parameters
    ----------
    width, height
        Size of the frames, pixels.

    Raises
    ------
    ImageError
        No search window fits into such a frame.
    """

    def __init__(self, model: LinearModel, settings: Settings, width: int, height: int) -> None:
        self._engine = make_search(model, settings, width, height)
        self._probability = settings.search.probability
        self._heat = scale_lengths(settings.heat, height / settings.reference_height)
        self._map = HeatMap(width, height, self._heat)

    def detect(self, image: Image) -> Detection:
        """Search the next frame, BGR uint8 `(H, W, 3)`."""
        windows = self._engine.search(image)
        hits = windows.detected(self._probability)
        heat = self._map.update(hits)
        return Detection(windows, hits, heat, tuple(find_regions(heat, self._heat.threshold)))


def detect_still(model: LinearModel, settings: Settings, image: Image) -> Detection:
    """Search a single picture as if it stood still for `heat.frames` frames.

    So the threshold means the same as in video. Raises `ImageError` like `Detector`.
    """
    height, width = image.shape[:2]
    once = settings.model_copy(update={"heat": settings.heat.model_copy(update={"frames": 1})})
    threshold = settings.heat.threshold
    detection = Detector(model, once, width, height).detect(image)
    heat = detection.heat * settings.heat.frames
    return replace(detection, heat=heat, regions=tuple(find_regions(heat, threshold)))


def still_boxes(detection: Detection, settings: Settings, height: int) -> list[tuple[Box, float]]:
    """Return box and peak of the regions that are large enough for the tracker (`min_region`)."""
    least = scale_lengths(settings.tracker, height / settings.reference_height).min_region
    return [
        (region.box, region.peak)
        for region in detection.regions
        if region.box.width >= least and region.box.height >= least
    ]
