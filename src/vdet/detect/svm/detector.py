"""The linear model as a detector: windows → heat → hot regions → detections."""

import logging
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vdet.config.schema import StillSettings, SvmSettings
from vdet.config.section import scale_lengths
from vdet.detect.detections import Detections
from vdet.detect.svm.heat import Heat, HeatMap, HotRegion, find_regions
from vdet.detect.svm.horizon import DEFAULT_HORIZON, find_horizon
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.scores import detection_scores
from vdet.detect.svm.search import FrameSearch
from vdet.detect.svm.stages import Trace, stage_pictures
from vdet.detect.svm.votes import Votes, split_regions
from vdet.detect.svm.windows import Windows
from vdet.geometry import are_nested
from vdet.media import Picture
from vdet.media.images import Image
from vdet.regions import SearchArea

log = logging.getLogger("vdet")

WEAK, STRONG = 0.2, 0.5
"""Scores of the detections that are counted to tell whether the model knows the road."""

COUNTED = 150
"""So many detections are counted."""

LEAST_STRONG = 0.75
"""The share of strong ones among them on a road that the shipped model knows; it is 0.87 to 0.97 on
the project video, and 0.33 to 0.74 in nine sets of pictures of other roads."""


@dataclass(frozen=True, slots=True)
class Candidates:
    """What the search of one frame gives.

    `windows` are all that were searched. A still picture is no frame of a video.
    """

    windows: Windows
    is_still: bool


class SvmModel:
    """A linear model with its settings: a `DetectorModel`.

    Parameters
    ----------
    is_shipped
        Its detectors warn of roads that the shipped model does not know. How sure another model is
        on the roads that it knows is not known.
    """

    def __init__(
        self, model: LinearModel, settings: SvmSettings, *, is_shipped: bool = False
    ) -> None:
        self._model = model
        self._settings = settings
        self._is_shipped = is_shipped

    def for_video(self, width: int, height: int, images: Sequence[Image]) -> "SvmDetector":
        """Return a detector for frames of one size; `images` show where the horizon is."""
        horizon = horizon_of(self._settings, images)
        if self._settings.search.perspective.sizes:
            log.info("the horizon lies at %.2f of the height", horizon)
        return SvmDetector(
            self._model,
            self._settings,
            width,
            height,
            horizon=horizon,
            is_shipped=self._is_shipped,
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
    is_shipped
        As of `SvmModel`.

    Raises
    ------
    FrameSizeError
        No search window fits into such a frame.
    ImageError
        Too many windows fit into such a frame.
    ConfigError
        The dense engine is asked for, and cannot compute the model's features.
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
        is_shipped: bool = False,
    ) -> None:
        self._is_shipped = is_shipped
        self._search = FrameSearch(model, settings, width, height, horizon=horizon, area=area)
        self._model = model
        self._horizon = horizon
        self._features = model.features
        self._size = width, height
        self._settings = settings
        self._heat = scale_lengths(settings.heat, height / settings.reference_height)
        self._map = HeatMap(width, height, self._heat)
        self._recent: deque[Windows] = deque(maxlen=self._heat.frames)
        self._weak = self._strong = 0

    def limited_to(self, area: SearchArea) -> "SvmDetector":
        """Return a detector that leaves out windows far from an area. Raises `ImageError`."""
        return SvmDetector(
            self._model,
            self._settings,
            *self._size,
            horizon=self._horizon,
            area=area,
            is_shipped=self._is_shipped,
        )

    def search(self, picture: Picture, index: int | None) -> Candidates:
        """Search the windows of a frame; several threads may call this at once."""
        return Candidates(self._search.search(picture), is_still=index is None)

    def detect(self, candidates: Candidates) -> Detections:
        """Add the hits of the next frame to the heat, and return what is hot.

        A still picture counts as `heat.frames` frames that all show it, so that thresholds mean the
        same as in video.
        """
        hits = candidates.windows.hits(self._settings.search.probability)
        for _ in range(self._heat.frames if candidates.is_still else 1):
            heat = self._map.update(hits)
            self._recent.append(hits)
        regions = self._regions(heat)
        if candidates.is_still:
            regions = self._shown_in_still(regions, self._settings.stills)
        trace = Trace(candidates.windows, hits, heat, self._search.grids)
        detections = self._detections(regions, trace)
        self._count(detections)
        return detections

    def stage_pictures(self, image: Image, detections: Detections) -> dict[str, Image]:
        """Return pictures of patches and their features, the windows, the hits and the heat."""
        return stage_pictures(image, detections.trace, self._features)

    def _regions(self, heat: Heat) -> list[HotRegion]:
        regions = find_regions(heat, self._heat.threshold)
        if self._heat.regions == "votes":
            votes = Votes.of(self._recent, self._size, self._heat.votes)
            regions = split_regions(regions, votes, self._heat.votes)
        inside = (replace(region, box=region.box.clipped(*self._size)) for region in regions)
        return [region for region in inside if region.box.area]

    def _shown_in_still(
        self, regions: Sequence[HotRegion], stills: StillSettings
    ) -> list[HotRegion]:
        shown = [each for each in regions if self._is_shown(each, stills)]
        boxes = [(b.x, b.y, b.width, b.height) for b in (each.box for each in shown)]
        strengths = [each.strength for each in shown]
        dropped = are_nested(np.reshape(np.array(boxes, np.float64), (-1, 4)), strengths)
        return [each for each, drop in zip(shown, dropped.tolist(), strict=True) if not drop]

    def _is_shown(self, region: HotRegion, stills: StillSettings) -> bool:
        width, height = self._size
        return (
            region.strength >= stills.strength
            and region.box.width >= stills.width * width
            and region.box.height >= stills.height * height
        )

    def _count(self, detections: Detections) -> None:
        """Warn once of a road that looks unlike those that the shipped model has learnt."""
        if not self._is_shipped or self._weak >= COUNTED:
            return
        self._weak += int(np.count_nonzero(detections.scores >= WEAK))
        self._strong += int(np.count_nonzero(detections.scores >= STRONG))
        if self._weak >= COUNTED and self._strong < LEAST_STRONG * self._weak:
            log.warning(
                "the model does not seem to know this road: %d of %d detections are doubtful; "
                "the network (-c net) knows more roads",
                self._weak - self._strong,
                self._weak,
            )

    def _detections(self, regions: Sequence[HotRegion], trace: Trace) -> Detections:
        strengths = np.array([region.strength for region in regions], np.float32)
        boxes = [(b.x, b.y, b.right, b.bottom) for b in (region.box for region in regions)]
        return Detections(
            np.reshape(boxes, (-1, 4)),
            detection_scores(strengths, self._settings.score),
            centroids=np.reshape([region.centroid for region in regions], (-1, 2)),
            strengths=strengths,
            trace=trace,
        )


def horizon_of(settings: SvmSettings, images: Sequence[Image]) -> float:
    """Return the row of the horizon, share of the height: from the settings, or from `images`."""
    perspective = settings.search.perspective
    if not perspective.sizes:
        return DEFAULT_HORIZON  # no window set depends on it
    return perspective.horizon or find_horizon(images)
