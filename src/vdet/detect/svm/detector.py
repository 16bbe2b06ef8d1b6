"""The linear model as a detector: windows → heat → hot regions → detections."""

import logging
from collections import deque
from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace

import numpy as np

from vdet.boxes import Boxes, are_nested
from vdet.config.schema import SvmSettings
from vdet.config.section import REFERENCE_HEIGHT, scale_lengths
from vdet.detect.svm.heat import Heat, HeatMap, HotRegion, find_regions
from vdet.detect.svm.horizon import DEFAULT_HORIZON, find_horizon
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.road_check import RoadCheck
from vdet.detect.svm.search import FrameSearch
from vdet.detect.svm.stages import Trace, stage_pictures
from vdet.detect.svm.votes import Votes, split_regions
from vdet.detect.svm.windows import Windows
from vdet.media import Picture
from vdet.media.images import Image
from vdet.regions import SearchArea

log = logging.getLogger("vdet")


@dataclass(frozen=True, slots=True)
class Candidates:
    """What the search of one frame gives.

    `windows` are all that were searched. A still picture is no frame of a video. `picture` is the
    frame, where `RoadCheck` may need it.
    """

    windows: Windows
    is_still: bool
    picture: Picture | None = None


class SvmModel:
    """A linear model with its settings: a `DetectorModel`.

    Parameters
    ----------
    check
        Warns of a road that the model does not know; None for no warning.
    """

    def __init__(
        self, model: LinearModel, settings: SvmSettings, *, check: RoadCheck | None = None
    ) -> None:
        self._model = model
        self._settings = settings
        self._check = check

    def for_video(self, width: int, height: int, images: Sequence[Image]) -> "SvmDetector":
        """Return a detector for frames of one size; `images` show where the horizon is."""
        horizon = horizon_of(self._settings, images)
        if self._settings.search.perspective.sizes:
            log.info("the horizon lies at %.2f of the height", horizon)
        return SvmDetector(
            self._model, self._settings, width, height, horizon=horizon, check=self._check
        )


class SvmDetector:
    """Finds vehicles in consecutive frames of one size: a `VideoDetector`.

    Parameters
    ----------
    width, height
        Size of the frames, pixels.
    horizon
        Row of the horizon, share of the frames' height (`horizon_of`).
    area
        Where vehicles are looked for; None for the whole frame.
    check
        As of `SvmModel`.

    Raises
    ------
    FrameSizeError
        No search window fits into such a frame.
    ImageError
        Too many windows fit into such a frame.
    """

    def __init__(
        self,
        model: LinearModel,
        settings: SvmSettings,
        width: int,
        height: int,
        *,
        horizon: float = DEFAULT_HORIZON,
        area: SearchArea | None = None,
        check: RoadCheck | None = None,
    ) -> None:
        self._check = check
        self._search = FrameSearch(model, settings, width, height, horizon=horizon, area=area)
        self._model = model
        self._horizon = horizon
        self._area = area
        self._features = model.features
        self._size = width, height
        self._settings = settings
        self._heat = scale_lengths(settings.heat, height / REFERENCE_HEIGHT)
        self._map = HeatMap(width, height, self._heat)
        self._recent: deque[Windows] = deque(maxlen=self._heat.frames)

    def limited_to(self, area: SearchArea) -> "SvmDetector":
        """Return a detector that leaves out windows far from an area. Raises `ImageError`."""
        return self._twin(area, self._check)

    def search(self, picture: Picture, index: int | None) -> Candidates:
        """Search the windows of a frame; several threads may call this at once."""
        windows = self._search.search(picture)
        return Candidates(windows, index is None, picture if self._check else None)

    def detect(self, candidates: Candidates) -> Boxes:
        """Add the hits of the next frame to the heat, and return what is hot.

        A still picture counts as `heat.frames` frames that all show it, so that thresholds mean the
        same as in video.
        """
        hits = candidates.windows.hits(self._settings.search.probability)
        for _ in range(self._heat.frames if candidates.is_still else 1):
            heat = self._map.update(hits)
            self._recent.append(hits)
        trace = Trace(candidates.windows, hits, heat, self._search.grids)
        detections = self._detections(self._regions(heat), trace)
        if candidates.is_still:
            detections = self._shown_in_still(detections)
        if self._check and candidates.picture and self._check.is_due():
            self._check.compare(candidates.picture, self._as_still(candidates, detections))
        return detections

    def stage_pictures(self, image: Image, detections: Boxes) -> dict[str, Image]:
        """Return pictures of patches and their features, the windows, the hits and the heat."""
        return stage_pictures(image, detections.trace, self._features)

    def _as_still(self, candidates: Candidates, detections: Boxes) -> Boxes:
        """Return what is found where the frame is taken as a still picture."""
        if candidates.is_still:
            return detections
        return self._twin(self._area).detect(replace(candidates, is_still=True))

    def _twin(self, area: SearchArea | None, check: RoadCheck | None = None) -> "SvmDetector":
        return SvmDetector(
            self._model,
            self._settings,
            *self._size,
            horizon=self._horizon,
            area=area,
            check=check,
        )

    def _regions(self, heat: Heat) -> list[HotRegion]:
        regions = find_regions(heat, self._heat.threshold)
        if self._heat.regions == "votes":
            votes = Votes.of(self._recent, self._size)
            regions = split_regions(regions, votes, self._heat.votes)
        inside = (replace(region, box=region.box.clipped(*self._size)) for region in regions)
        return [region for region in inside if region.box.area]

    def _detections(self, regions: Sequence[HotRegion], trace: Trace) -> Boxes:
        strengths = np.array([region.strength for region in regions], np.float64)
        return Boxes(
            np.reshape([astuple(region.box) for region in regions], (-1, 4)),
            [self._settings.score.of(strength) for strength in strengths.tolist()],
            data={
                "centroid": np.reshape([region.centroid for region in regions], (-1, 2)),
                "strength": strengths,
            },
            trace=trace,
        )

    def _shown_in_still(self, found: Boxes) -> Boxes:
        """Return the detections that are strong and large enough, without those inside another."""
        stills, strengths = self._settings.stills, found.data["strength"]
        least = np.array([stills.width, stills.height]) * self._size
        sizes = found.sides[:, 2:] - found.sides[:, :2]
        shown = found[(strengths >= stills.strength) & (sizes >= least).all(axis=1)]
        return shown[~are_nested(shown.sides, shown.data["strength"])]


def horizon_of(settings: SvmSettings, images: Sequence[Image]) -> float:
    """Return the row of the horizon, share of the height: from the settings, or from `images`."""
    perspective = settings.search.perspective
    if not perspective.sizes:
        return DEFAULT_HORIZON  # no window set depends on it
    return find_horizon(images) if perspective.horizon is None else perspective.horizon
