"""The detector `svm`, a linear model: windows → heat → hot regions → detections."""

import logging
from collections import deque
from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from vdet.boxes import Box, Boxes, Image, are_nested, from_xywh
from vdet.config.schema import SvmSettings
from vdet.detect.svm.heat import Heat, HotRegion, Votes, find_regions, split_regions, sum_heat
from vdet.detect.svm.horizon import DEFAULT_HORIZON, find_horizon
from vdet.detect.svm.model import LinearModel, load_model
from vdet.detect.svm.search import DenseSearch, FramePyramid, vehicle_boxes
from vdet.detect.svm.windows import Windows, window_grids
from vdet.draw.boxes import GREEN, WHITE, color_of, draw_box, draw_label
from vdet.errors import FrameSizeError, ModelError
from vdet.media import Picture

log = logging.getLogger("vdet")


Candidates = tuple[Windows, bool]
"""All searched windows, and whether they are from a single image."""


@dataclass(frozen=True, slots=True)
class SearchTrace:
    """Data for the stage images of a frame.

    `hits` are the windows with at least `detector.search.probability`, `heat` is the heatmap of the
    last frames.
    """

    hits: Windows
    heat: Heat


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
        """
        horizon = self._horizon(images)
        return SvmDetector(self.model, self.settings, width, height, horizon=horizon)

    def _horizon(self, images: Sequence[Image]) -> float:
        """Return the row of the horizon, as a fraction of the height, and log it."""
        perspective = self.settings.search.perspective
        if not perspective.sizes:
            return DEFAULT_HORIZON  # no window set depends on it
        horizon = perspective.horizon
        if horizon is None and (horizon := find_horizon(images)) is None:
            # A folder may have many images without a horizon: only videos warn.
            level = logging.WARNING if len(images) > 1 else logging.INFO
            assumed = f"no horizon found: {DEFAULT_HORIZON} of the height is assumed"
            log.log(level, "%s; set detector.search.perspective.horizon", assumed)
            return DEFAULT_HORIZON
        log.info("the horizon is at %.2f of the height", horizon)
        return horizon


_ALIGNMENT = 16
"""The searched part begins at a multiple of this many pixels, so that it can be halved like its
windows.
"""


class SvmDetector:
    """Finds vehicles in consecutive frames of one size: a `VideoDetector`.

    Parameters
    ----------
    width, height
        Size of the frames, pixels.
    horizon
        Row of the horizon, fraction of the frames' height, for the perspective sets.

    Attributes
    ----------
    grids
        The window sets in the frame.

    Raises
    ------
    FrameSizeError
        No window fits into such a frame.
    """

    def __init__(
        self,
        model: LinearModel,
        settings: SvmSettings,
        width: int,
        height: int,
        *,
        horizon: float = DEFAULT_HORIZON,
    ) -> None:
        self._settings, self._features, self._size = settings, model.features, (width, height)
        self._recent: deque[Windows] = deque(maxlen=settings.heat.frames)
        self.grids = tuple(window_grids(settings, model.features, width, height, horizon=horizon))
        if not self.grids:
            raise FrameSizeError(f"no search window fits into {width}×{height} pixels")
        self._searches = [DenseSearch(model, grid) for grid in self.grids]
        self._boxes = np.concatenate([grid.boxes for grid in self.grids])
        weights = np.array([grid.weight for grid in self.grids], np.float32)
        self._weights = np.repeat(weights, list(map(len, self.grids)))
        left, top = self._boxes[:, :2].min(axis=0).tolist()
        right, bottom = (self._boxes[:, :2] + self._boxes[:, 2:]).max(axis=0).tolist()
        margin = -(-max(-left, right - width, 0) // _ALIGNMENT) * _ALIGNMENT
        self._searched = top // _ALIGNMENT * _ALIGNMENT, bottom, margin

    def search(self, picture: Picture, index: int | None) -> Candidates:
        """Search the windows of a frame, in the order of `grids`; threads may call this at once."""
        frame = FramePyramid(picture, self._features, *self._searched)
        probability = self._settings.search.probability
        results = [search.search(frame, probability) for search in self._searches]
        probabilities, sides = map(np.concatenate, zip(*results, strict=True))
        vehicles = vehicle_boxes(self._boxes.astype(np.float32), sides)
        return Windows(self._boxes, probabilities, self._weights, vehicles), index is None

    def detect(self, candidates: Candidates) -> Boxes:
        """Add the hits of the next frame to the heat, and return the detections.

        A single image counts as `heat.frames` identical frames, so that thresholds have the same
        meaning as in video.
        """
        windows, is_still = candidates
        hits = windows.hits(self._settings.search.probability)
        self._recent.extend([hits] * (self._settings.heat.frames if is_still else 1))
        heat = sum_heat(self._recent, self._size, self._settings.heat)
        regions = self._regions(heat)
        boxes = Boxes(
            np.reshape([astuple(region.box) for region in regions], (-1, 4)),
            [self._settings.score.of(region.strength) for region in regions],
            data={
                "centroid": np.reshape([region.centroid for region in regions], (-1, 2)),
                "strength": [region.strength for region in regions],
            },
            trace=SearchTrace(hits, heat),
        )
        return self._shown_in_still(boxes) if is_still else boxes

    def stage_images(self, image: Image, detections: Boxes) -> dict[str, Image]:
        """Return images of a frame, BGR uint8 `(H, W, 3)`: windows, hits, heat, threshold."""
        trace = detections.trace
        windows, hits = (image * 0.6).astype(np.uint8), image.copy()
        for number, grid in enumerate(self.grids):
            boxes, color = list(map(Box.of, from_xywh(grid.boxes).tolist())), color_of(number)
            draw_box(windows, boxes[0].union(boxes[-1]), color)
            example = boxes[number * grid.columns // len(self.grids)]
            draw_box(windows, example, color, f"{grid.size} px: {len(grid)} windows")
        hit_boxes = list(map(Box.of, from_xywh(trace.hits.boxes).tolist()))
        for row in np.argsort(trace.hits.probabilities).tolist():  # the most likely is on top
            draw_box(hits, hit_boxes[row], GREEN, f"{trace.hits.probabilities[row]:.2f}")
        heat = blend_heat(image, trace.heat)
        draw_label(heat, f"peak {trace.heat.peak:.1f}", (0, 0), WHITE)
        threshold = self._settings.heat.threshold
        hot = (trace.heat.values > threshold).astype(np.uint8).repeat(trace.heat.shrink, 0)
        hot = hot.repeat(trace.heat.shrink, 1)[: len(image), : image.shape[1]]
        contours, _ = cv2.findContours(hot, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        hot_parts = np.where(hot[..., np.newaxis], image, image // 3)
        cv2.drawContours(hot_parts, contours, -1, GREEN, 2)
        draw_label(hot_parts, f"heat above {threshold:g}", (0, 0), WHITE)
        return {"windows": windows, "hits": hits, "heat": heat, "threshold": hot_parts}

    def _regions(self, heat: Heat) -> list[HotRegion]:
        regions = find_regions(heat, self._settings.heat.threshold)
        if (minimum := self._settings.heat.votes) is not None:
            regions = split_regions(regions, Votes.of(self._recent, self._size), minimum)
        inside = (replace(region, box=region.box.clipped(*self._size)) for region in regions)
        return [region for region in inside if region.box.area]

    def _shown_in_still(self, boxes: Boxes) -> Boxes:
        """Return strong and large detections, without those nested in another."""
        settings = self._settings
        smallest = np.array(settings.min_size_still) * self._size
        large = (boxes.sides[:, 2:] - boxes.sides[:, :2] >= smallest).all(axis=1)
        shown = boxes[large & (boxes.scores >= settings.min_score_still)]
        return shown[~are_nested(shown.sides, shown.data["strength"])]


_MODELS = Path(__file__).parents[2] / "models"


def shipped_model(settings: SvmSettings) -> Path:
    """Return the shipped model that was trained with the features in the settings.

    Raises
    ------
    ModelError
        There is none.
    """
    for path in sorted(_MODELS.glob("*.npz")):
        if load_model(path).features == settings.features:
            return path
    raise ModelError("no shipped model has these features; set detector.model, or train one")


def load_svm(settings: SvmSettings, path: Path | None) -> SvmModel:
    """Load a linear model; `path` is its file, None for the shipped one.

    Features in the settings must equal those of the model.

    Raises
    ------
    ModelError
        The file cannot be used, or the model was trained with other features.
    """
    requested = settings.features if "features" in settings.model_fields_set else None
    model = load_model(path or shipped_model(settings), requested)
    return SvmModel(model, settings)


def blend_heat(image: Image, heat: Heat) -> Image:
    """Return the darkened image with the heat over it: black, red, white at the peak."""
    scale = 255 / heat.peak if heat.peak > 0 else 0
    shade = (heat.values * scale).astype(np.uint8)
    large = np.kron(shade, np.ones((heat.shrink, heat.shrink), np.uint8))
    colored = cv2.applyColorMap(large[: image.shape[0], : image.shape[1]], cv2.COLORMAP_HOT)
    return np.asarray(cv2.addWeighted(image, 0.5, colored, 0.8, 0), np.uint8)
