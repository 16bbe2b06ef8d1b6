"""One frame → its windows, heat and regions: what still pictures and video have in common."""

from dataclasses import dataclass, replace

from vdet.config.scaling import scale_lengths
from vdet.config.schema import Settings
from vdet.geometry import Box
from vdet.heatmap import Heat, HeatMap, Region, find_regions
from vdet.images import Image
from vdet.model import LinearModel
from vdet.search.engine import FrameSearch
from vdet.windows import NO_WINDOWS, Windows


@dataclass(frozen=True, slots=True)
class Detection:
    """What was found in a frame, before any memory of cars.

    `windows` are all searched ones, `hits` those of at least `search.probability`, `heat` is
    their heatmap, `regions` is where it exceeds `heat.threshold`.
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
        self._search = FrameSearch(model, settings, width, height)
        self._size = width, height
        self._probability = settings.search.probability
        self._heat = scale_lengths(settings.heat, height / settings.reference_height)
        self._map = HeatMap(width, height, self._heat)

    def search(self, image: Image) -> Windows:
        """Search a frame, BGR uint8 `(H, W, 3)`; may be called from threads, in any order."""
        return self._search.search(image)

    def accumulate(self, windows: Windows) -> Detection:
        """Add the windows of the next frame to the heat."""
        hits = windows.detected(self._probability)
        heat = self._map.update(hits)
        regions = find_regions(heat, self._heat.threshold)
        inside = tuple(replace(region, box=region.box.clipped(*self._size)) for region in regions)
        return Detection(windows, hits, heat, inside)


def nothing_detected(settings: Settings, width: int, height: int) -> Detection:
    """Return what is found in a frame of that size, pixels, where nothing is searched."""
    scaled = scale_lengths(settings.heat, height / settings.reference_height)
    heat = HeatMap(width, height, scaled).update(NO_WINDOWS)
    return Detection(NO_WINDOWS, NO_WINDOWS, heat, ())


def detect_still(model: LinearModel, settings: Settings, image: Image) -> Detection:
    """Search a single picture as if it stood still for `heat.frames` frames.

    So the threshold means the same as in video. Raises `ImageError` like `Detector`.
    """
    height, width = image.shape[:2]
    detector = Detector(model, settings, width, height)
    windows = detector.search(image)
    for _ in range(settings.heat.frames - 1):
        detector.accumulate(windows)
    return detector.accumulate(windows)


def still_boxes(detection: Detection, settings: Settings, height: int) -> list[tuple[Box, float]]:
    """Return box and peak of the regions that are large enough for the tracker (`min_region`)."""
    least = scale_lengths(settings.tracker, height / settings.reference_height).min_region
    return [
        (region.box, region.peak)
        for region in detection.regions
        if region.box.width >= least and region.box.height >= least
    ]
