"""One frame → its windows, heat and regions: what still pictures and video have in common."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace

from vdet.config.scaling import scale_lengths
from vdet.config.schema import Settings
from vdet.detect.svm.heat import Heat, HeatMap, Region, find_regions
from vdet.detect.svm.horizon import USUAL, find_horizon
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.search import FrameSearch
from vdet.detect.svm.votes import Votes, split_regions
from vdet.detect.svm.windows import NO_WINDOWS, WindowGrid, Windows
from vdet.geometry import Box
from vdet.media.images import Image


@dataclass(frozen=True, slots=True)
class Detection:
    """What was found in a frame, before any memory of cars.

    `windows` are the searched ones, `hits` those of at least `search.probability`, `heat` is
    the heatmap of the last frames, `regions` is what is hot in it (`heat.threshold`,
    `heat.regions`), `grids` are the window sets.
    """

    windows: Windows
    hits: Windows
    heat: Heat
    regions: tuple[Region, ...]
    grids: tuple[WindowGrid, ...]


class Detector:
    """Finds regions in consecutive frames of one size.

    Parameters
    ----------
    width, height
        Size of the frames, pixels.
    horizon
        Its row, share of the frames' height (`horizon_of`).

    Raises
    ------
    ImageError
        No search window fits into such a frame.
    """

    def __init__(
        self,
        model: LinearModel,
        settings: Settings,
        width: int,
        height: int,
        *,
        horizon: float = USUAL,
    ) -> None:
        self._search = FrameSearch(model, settings, width, height, horizon=horizon)
        self._size = width, height
        self._probability = settings.search.probability
        self._heat = scale_lengths(settings.heat, height / settings.reference_height)
        self._map = HeatMap(width, height, self._heat)
        self._recent: deque[Windows] = deque(maxlen=self._heat.frames)

    def search(self, image: Image, turn: int | None = None) -> Windows:
        """Search a frame, BGR uint8 `(H, W, 3)`; may be called from threads, in any order.

        `turn` is the number of a video's frame; None searches all window sets at once.
        """
        return self._search.search(image, turn)

    def accumulate(self, windows: Windows) -> Detection:
        """Add the windows of the next frame to the heat."""
        hits = windows.detected(self._probability)
        heat = self._map.update(hits)
        self._recent.append(hits)
        regions = find_regions(heat, self._heat.threshold)
        if self._heat.regions == "votes":
            votes = Votes.of(self._recent, self._size, self._heat.votes)
            regions = split_regions(regions, votes, self._heat.votes)
        inside = (replace(region, box=region.box.clipped(*self._size)) for region in regions)
        visible = tuple(region for region in inside if region.box.area)
        return Detection(windows, hits, heat, visible, self._search.grids)


def horizon_of(settings: Settings, images: Sequence[Image]) -> float:
    """Return the horizon's row, share of the height: the set one, or that which `images` show."""
    perspective = settings.search.perspective
    if not perspective.sizes:
        return USUAL  # nothing depends on it
    return perspective.horizon or find_horizon(images)


def nothing_detected(settings: Settings, width: int, height: int) -> Detection:
    """Return what is found in a frame of that size, pixels, where nothing is searched."""
    scaled = scale_lengths(settings.heat, height / settings.reference_height)
    heat = HeatMap(width, height, scaled).update(NO_WINDOWS)
    return Detection(NO_WINDOWS, NO_WINDOWS, heat, (), ())


def detect_still(model: LinearModel, settings: Settings, image: Image) -> Detection:
    """Search a single picture as if it stood still for `heat.frames` frames.

    So the threshold means the same as in video. Raises `ImageError` like `Detector`.
    """
    height, width = image.shape[:2]
    detector = Detector(model, settings, width, height, horizon=horizon_of(settings, [image]))
    for turn in range(settings.heat.frames):
        detection = detector.accumulate(detector.search(image, turn))
    windows = detector.search(image)
    return replace(detection, windows=windows, hits=windows.detected(settings.search.probability))


def still_boxes(
    detection: Detection, settings: Settings, width: int, height: int
) -> list[tuple[Box, float]]:
    """Return box and peak of the regions of a picture that the tracker would take for vehicles.

    By the rules these are the large enough ones (`min_region`); by motion those that are large
    enough (`motion.smallest`) and seen clearly enough for one look (`motion.still`).
    """
    regions = ((region.box, region.peak) for region in detection.regions)
    if settings.tracker.method == "rules":
        least = scale_lengths(settings.tracker, height / settings.reference_height).min_region
        return [each for each in regions if min(each[0].width, each[0].height) >= least]
    motion = settings.tracker.motion
    return [
        (box, peak)
        for box, peak in regions
        if box.width >= motion.smallest * width and peak >= motion.still * motion.strong
    ]
