"""The linear model as a detector: windows → heat → hot regions → detections."""

import logging
from collections import deque
from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace

import numpy as np

from vdet.boxes import Boxes, Image, are_nested
from vdet.config.schema import SvmSettings
from vdet.detect.svm.heat import Heat, HotRegion, find_regions, sum_heat
from vdet.detect.svm.horizon import DEFAULT_HORIZON, find_horizon
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.search import FrameSearch
from vdet.detect.svm.stages import Trace, stage_pictures
from vdet.detect.svm.votes import Votes, split_regions
from vdet.detect.svm.windows import Windows
from vdet.media import Picture

log = logging.getLogger("vdet")


@dataclass(frozen=True, slots=True)
class Candidates:
    """What the search of one frame gives.

    `windows` are all that were searched. `is_still` tells a still picture from a frame of a video.
    """

    windows: Windows
    is_still: bool


@dataclass(frozen=True, slots=True, eq=False)
class SvmModel:
    """A linear model with its settings: a `DetectorModel`."""

    model: LinearModel
    settings: SvmSettings

    def for_video(self, width: int, height: int, images: Sequence[Image]) -> "SvmDetector":
        """Return a detector for frames of one size; `images` show where the horizon is.

        Raises
        ------
        FrameSizeError
            No search window fits into such a frame.
        ImageError
            Too many windows fit into such a frame.
        """
        horizon = self._horizon(images)
        search = FrameSearch(self.model, self.settings, width, height, horizon=horizon)
        return SvmDetector(search, self.settings, (width, height))

    def _horizon(self, images: Sequence[Image]) -> float:
        """Return the row of the horizon, as a fraction of the height, and report it."""
        perspective = self.settings.search.perspective
        if not perspective.sizes:
            return DEFAULT_HORIZON  # no window set depends on it
        horizon = perspective.horizon
        if horizon is None and (horizon := find_horizon(images)) is None:
            # A folder may hold many pictures without a horizon: only videos warn.
            level = logging.WARNING if len(images) > 1 else logging.INFO
            found = f"no horizon is found: {DEFAULT_HORIZON} of the height is assumed"
            log.log(level, "%s; set detector.search.perspective.horizon", found)
            return DEFAULT_HORIZON
        log.info("the horizon lies at %.2f of the height", horizon)
        return horizon


class SvmDetector:
    """Finds vehicles in consecutive frames of one size: a `VideoDetector`.

    Parameters
    ----------
    size
        Width and height of the frames, pixels.
    """

    def __init__(self, search: FrameSearch, settings: SvmSettings, size: tuple[int, int]) -> None:
        self._search, self._settings, self._size = search, settings, size
        self._heat = settings.heat
        self._recent: deque[Windows] = deque(maxlen=self._heat.frames)

    def search(self, picture: Picture, index: int | None) -> Candidates:
        """Search the windows of a frame; several threads may call this at once."""
        return Candidates(self._search.search(picture), is_still=index is None)

    def detect(self, candidates: Candidates) -> Boxes:
        """Add the hits of the next frame to the heat, and return what is hot.

        A still picture counts as `heat.frames` frames that all show it, so that thresholds mean the
        same as in video.
        """
        hits = candidates.windows.hits(self._settings.search.probability)
        self._recent.extend([hits] * (self._heat.frames if candidates.is_still else 1))
        heat = sum_heat(self._recent, self._size, self._heat)
        found = self._found(self._regions(heat), Trace(hits, heat, self._search.grids))
        return self._shown_in_still(found) if candidates.is_still else found

    def stage_pictures(self, image: Image, detections: Boxes) -> dict[str, Image]:
        """Return pictures of the windows, the hits and the heat."""
        return stage_pictures(image, detections.trace)

    def _regions(self, heat: Heat) -> list[HotRegion]:
        regions = find_regions(heat, self._heat.threshold)
        if self._heat.votes is not None:
            votes = Votes.of(self._recent, self._size)
            regions = split_regions(regions, votes, self._heat.votes)
        inside = (replace(region, box=region.box.clipped(*self._size)) for region in regions)
        return [region for region in inside if region.box.area]

    def _found(self, regions: Sequence[HotRegion], trace: Trace) -> Boxes:
        sides = np.reshape([astuple(region.box) for region in regions], (-1, 4))
        scores = [self._settings.score.of(region.strength) for region in regions]
        data = {
            "centroid": np.reshape([region.centroid for region in regions], (-1, 2)),
            "strength": np.array([region.strength for region in regions], np.float64),
        }
        return Boxes(sides, scores, data=data, trace=trace)

    def _shown_in_still(self, found: Boxes) -> Boxes:
        """Return the detections that are strong and large enough, without those inside another."""
        settings = self._settings
        smallest = np.array(settings.min_size_still) * self._size
        large = (found.sides[:, 2:] - found.sides[:, :2] >= smallest).all(axis=1)
        shown = found[large & (found.scores >= settings.min_score_still)]
        return shown[~are_nested(shown.sides, shown.data["strength"])]
