"""The detector `svm`, a linear model: windows → heat → hot regions and their votes → detections.

The heatmap is the sum of the hits of the last frames. A hit adds to the pixels of its vehicle
(`Windows.vehicles`), which with box regression is smaller than the window. The original system
summed heat in the same way.

Each hit votes for the box of the vehicle in its window. A vote has two weights. `presence`, for the
existence of a vehicle, is the probability of the hit, which soon approaches 1. `position`, for the
position of the box, is unbounded, and is highest for the window that fits the vehicle best.

The box with the most agreement is a vehicle. Its votes are averaged and removed, and the others
vote again. This is greedy non-maximum suppression that averages boxes instead of picking one, as
Viola & Jones merge detections ("Robust Real-Time Face Detection", 2004, section 5.6).
"""

import logging
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import astuple, dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import (
    BoolArray,
    Box,
    Boxes,
    Float32Array,
    Float64Array,
    Image,
    are_nested,
    area,
    clipped,
    coverage,
    from_xywh,
    iou_matrix,
)
from vdet.config.kinds import FeatureSettings, HeatSettings
from vdet.config.schema import SvmSettings
from vdet.config.section import REFERENCE_HEIGHT
from vdet.detect.svm.model import (
    LinearModel,
    cut_window,
    histogram,
    hog_descriptors,
    load_model,
    resize,
    split,
)
from vdet.detect.svm.windows import (
    DEFAULT_HORIZON,
    DenseSearch,
    FramePyramid,
    Windows,
    find_horizon,
    vehicle_boxes,
    window_grids,
)
from vdet.draw import GREEN, WHITE, color_of, draw_box, draw_label, draw_lines, fill
from vdet.errors import FrameSizeError, ModelError
from vdet.media import Picture

_BLUR = 15
"""Side of the Gaussian kernel that blurs the heat, in pixels of `REFERENCE_HEIGHT` rows."""
_SHRINK = 4
"""Width and height in pixels of a heat value, with votes; 1 with outlines."""

MAX_VOTES = 400
"""Maximum number of votes in a group of regions, because time grows with its square."""

_MAX_PROBABILITY = 1 - 2**-24
"""Limit of probabilities, because the position weight of 1 is infinite."""

_AGREEMENT = 0.35
"""Minimum intersection over union of two boxes that agree."""

_INSIDE = 0.7
"""A box with more than this fraction inside a larger vehicle is a part of it."""

_SHARPNESS = 4.0
"""Exponent of -log(1 - probability) in the `position` weight, so that the best fit counts most."""

_FAR_STRONGER = 4
"""Minimum ratio of weights for a box inside another one to be kept."""

log = logging.getLogger("vdet")

Candidates = tuple[Windows, bool]
"""All searched windows, and whether they are from a single image."""

_ALIGNMENT = 16
"""The searched part begins at a multiple of this many pixels, so that it can be halved like its
windows.
"""

_DRAWN = 384
"""Side of each part of the picture of features, pixels."""

_MODELS = Path(__file__).parents[2] / "models"


@dataclass(frozen=True, slots=True)
class Heat:
    """A heatmap: float32 `values`, each for `shrink` × `shrink` pixels of the frame."""

    values: Float32Array
    shrink: int = 1

    @property
    def peak(self) -> float:
        """The highest value."""
        return float(self.values.max(initial=0))

    def enlarged(self, values: Image, image: Image) -> Image:
        """Return one of `values` for each pixel of an image, in place of one for each heat."""
        large = values.repeat(self.shrink, axis=0).repeat(self.shrink, axis=1)
        return large[: image.shape[0], : image.shape[1]]


@dataclass(frozen=True, slots=True)
class HotRegion:
    """A part of a frame with evidence for a vehicle.

    Attributes
    ----------
    box
        Its bounding rectangle, pixels of the frame.
    centroid
        Its centre of mass `(x, y)`, pixels of the frame.
    strength
        The highest heat in it; for a region found by votes, their weight.
    """

    box: Box
    centroid: tuple[float, float]
    strength: float


def sum_heat(recent: Sequence[Windows], size: tuple[int, int], settings: HeatSettings) -> Heat:
    """Return the blurred sum of the hits of the last frames.

    Each hit adds to the values that its vehicle covers: its probability or, with `votes`,
    its probability times its weight.

    Parameters
    ----------
    recent
        The hits of each frame.
    size
        Width and height of the frames, pixels.
    """
    by_votes = settings.votes is not None
    shrink = _SHRINK if by_votes else 1
    total = np.zeros([-(-side // shrink) for side in reversed(size)], np.float32)
    for hits in recent:
        values = np.zeros_like(total)
        heats = hits.probabilities * hits.weights if by_votes else hits.probabilities
        sides = np.maximum(0, np.floor(from_xywh(hits.vehicles) / shrink + 0.5)).astype(np.int64)
        for (left, top, right, bottom), heat in zip(sides.tolist(), heats.tolist(), strict=True):
            values[top:bottom, left:right] += heat
        total += values
    side = int(_BLUR * size[1] / REFERENCE_HEIGHT + 0.5) // shrink | 1  # a kernel has a middle
    if side > 1:
        cv2.GaussianBlur(total, (side, side), 0, dst=total)
    return Heat(total, shrink)


def find_regions(heat: Heat, threshold: float) -> list[HotRegion]:
    """Return the connected regions where `heat` is above `threshold`, from top to bottom.

    A region with a hole is one region: only outer contours count. The centroid is that of the
    filled contour (`cv2.moments`), or the centre of the box if the contour is a line or a point.
    """
    hot = (heat.values > threshold).astype(np.uint8)
    contours, _ = cv2.findContours(hot, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    regions = [_region(heat, hot, contour) for contour in contours]
    return sorted(regions, key=lambda region: (region.box.y1, region.box.x1))


def _region(heat: Heat, hot: npt.NDArray[np.uint8], contour: cv2.typing.MatLike) -> HotRegion:
    x, y, width, height = cv2.boundingRect(contour)
    inside, part = np.zeros((height, width), np.uint8), np.s_[y : y + height, x : x + width]
    cv2.drawContours(inside, [contour], -1, 1, cv2.FILLED, offset=(-x, -y))
    peak = float(heat.values[part][(inside & hot[part]) > 0].max())
    n, moments = heat.shrink, cv2.moments(contour)
    box = Box.sized(n * x, n * y, n * width, n * height)
    if not (area := moments["m00"]):
        return HotRegion(box, box.center, peak)
    offset = (n - 1) / 2  # from the first pixel of a value to their middle
    centroid = (n * moments["m10"] / area + offset, n * moments["m01"] / area + offset)
    return HotRegion(box, centroid, peak)


@dataclass(frozen=True, slots=True)
class Votes:
    """The votes of some hits.

    Attributes
    ----------
    boxes
        float64 `(n, 4)`: x1, y1, x2, y2, pixels of the frame.
    presence
        float64 `(n,)`: weight for the existence of a vehicle.
    position
        float64 `(n,)`, above 0: weight for the sides of the box.
    """

    boxes: Float64Array
    presence: Float64Array
    position: Float64Array

    @staticmethod
    def of(hits: Sequence[Windows], size: tuple[int, int]) -> "Votes":
        """Collect the votes of the hits of some frames.

        Boxes are clipped to the frame of `size` (width and height, pixels), because windows can
        only guess how far a vehicle extends beyond it.
        """
        boxes = from_xywh(np.concatenate([hit.vehicles for hit in hits]))
        weights = np.concatenate([hit.weights for hit in hits], dtype=np.float64)
        probabilities = np.concatenate([hit.probabilities for hit in hits], dtype=np.float64)
        bounded = np.clip(probabilities, 1 - _MAX_PROBABILITY, _MAX_PROBABILITY)
        position, inside = (-np.log1p(-bounded)) ** _SHARPNESS, clipped(boxes, size)
        seen = (inside[:, 2:] - inside[:, :2] >= 1).all(axis=1)
        return Votes(inside[seen], (probabilities * weights)[seen], position[seen])

    def within(self, boxes: Iterable[Box]) -> "Votes":
        """Return the votes whose centre lies in one of `boxes`, each once.

        At most `MAX_VOTES` are returned, those with the highest `position`.
        """
        x, y = ((self.boxes[:, :2] + self.boxes[:, 2:]) / 2).T
        inside = np.zeros(len(x), np.bool_)
        for box in boxes:
            inside |= (box.x1 <= x) & (x < box.x2) & (box.y1 <= y) & (y < box.y2)
        (indices,) = np.nonzero(inside)
        best = np.argsort(-self.position[indices], kind="stable")[:MAX_VOTES]
        indices = np.sort(indices[best])
        return Votes(self.boxes[indices], self.presence[indices], self.position[indices])


def split_regions(regions: Sequence[HotRegion], votes: Votes, minimum: float) -> list[HotRegion]:
    """Return the vehicles that the votes in the regions agree on, strongest first in each region.

    Regions whose boxes overlap are split together, so that no vote counts twice. A box inside a
    larger one is kept only if it is far stronger; the tracker, or `SvmDetector` for a single image,
    shows one of the two. `minimum` is the minimum weight of agreeing votes.
    """
    groups = _overlapping([region.box for region in regions])
    rows = [row for group in groups for row in _vehicles(votes.within(group), minimum)]
    vehicles = np.reshape(rows, (-1, 6))
    sides, position = vehicles[:, :4], vehicles[:, 4]
    is_part: BoolArray = coverage(sides, sides) > _INSIDE
    is_part &= area(sides) > area(sides)[:, np.newaxis]
    is_part &= _FAR_STRONGER * position > position[:, np.newaxis]
    kept = vehicles[~is_part.any(axis=1)].tolist()
    whole = [(Box.of(row[:4]), presence) for *row, presence in kept]
    return [HotRegion(box.rounded, box.center, presence) for box, presence in whole]


def _overlapping(boxes: Iterable[Box]) -> list[list[Box]]:
    """Group boxes that overlap, directly or through others."""
    groups: list[list[Box]] = []
    for box in boxes:
        joined, apart = [box], []
        for group in groups:
            if any(box.intersection(member).area for member in group):
                joined = group + joined
            else:
                apart.append(group)
        groups = [*apart, joined]
    return groups


def _vehicles(votes: Votes, minimum: float) -> Iterator[Float64Array]:
    """Yield the vehicles that votes agree on, the one with most agreement first.

    Each is `(6,)`: its sides, and the weights of its position and presence.
    """
    overlaps = iou_matrix(votes.boxes, votes.boxes)
    presence, position = votes.presence.copy(), votes.position.copy()
    # Presence only falls: when no box has enough, no more will be found.
    while position.any() and (overlaps @ presence).max() >= minimum:
        agreed = np.where(position > 0, overlaps @ position, 0)
        mode = int(agreed.argmax())
        box = _average(votes.boxes, position, overlaps[mode])
        around = iou_matrix(box[np.newaxis], votes.boxes)[0]
        box = _average(votes.boxes, position, around)
        weight = float(overlaps[mode] @ presence)
        used = np.maximum(around, overlaps[mode]) > _AGREEMENT
        used[mode] = True
        if weight >= minimum:
            yield np.array([*box, agreed[mode], weight])
            used |= coverage(votes.boxes, box[np.newaxis])[:, 0] > _INSIDE
        presence[used] = position[used] = 0


def _average(boxes: Float64Array, weights: Float64Array, overlaps: Float64Array) -> Float64Array:
    """Average the boxes that agree; a better overlap counts more."""
    agreeing = np.where(overlaps > _AGREEMENT, weights * overlaps**2, 0)
    if not (total := agreeing.sum()):
        return np.asarray(boxes[int(overlaps.argmax())])
    return np.asarray(agreeing @ boxes / total)


SearchTrace = tuple[Windows, Heat]
"""For the stage images of a frame: the windows with at least `detector.search.probability`, and the
heatmap of the last frames.
"""


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
            trace=(hits, heat),
        )
        return self._shown_in_still(boxes) if is_still else boxes

    def stage_images(self, image: Image, detections: Boxes) -> dict[str, Image]:
        """Return images of a frame, BGR uint8, by their names.

        They are the windows, the features of the best hit or else of the first window, the hits,
        the heat, and where it is above the threshold.
        """
        trace: SearchTrace = detections.trace
        found, heat = trace
        windows, hits = (image * 0.6).astype(np.uint8), image.copy()
        for number, grid in enumerate(self.grids):
            boxes, color = list(map(Box.of, from_xywh(grid.boxes).tolist())), color_of(number)
            draw_box(windows, boxes[0].union(boxes[-1]), color)
            example = boxes[number * grid.columns // len(self.grids)]
            draw_box(windows, example, color, f"{grid.size} px: {len(grid)} windows")
        hit_boxes = list(map(Box.of, from_xywh(found.boxes).tolist()))
        for row in np.argsort(found.probabilities).tolist():  # the most likely is on top
            draw_box(hits, hit_boxes[row], GREEN, f"{found.probabilities[row]:.2f}")
        blended = blend_heat(image, heat)
        draw_label(blended, f"peak {heat.peak:.1f}", (0, 0), WHITE)
        threshold = self._settings.heat.threshold
        hot = heat.enlarged((heat.values > threshold).astype(np.uint8), image)
        contours, _ = cv2.findContours(hot, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        hot_parts = np.where(hot[..., np.newaxis], image, image // 3)
        cv2.drawContours(hot_parts, contours, -1, GREEN, 2)
        draw_label(hot_parts, f"heat above {threshold:g}", (0, 0), WHITE)
        shown = (
            found.boxes[np.argsort(-found.probabilities)]
            if len(found.boxes)
            else self.grids[0].boxes
        )
        patch = resize(cut_window(image, *shown[0].tolist()), *[self._features.patch] * 2)
        features = draw_features(patch, self._features)
        pictures = {"windows": windows, "features": features, "hits": hits}
        return pictures | {"heat": blended, "threshold": hot_parts}

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


def draw_features(patch: Image, settings: FeatureSettings) -> Image:
    """Return a patch, the HOG of its luma, and the histograms of its channels, side by side.

    The strokes of a cell run along its edges, and are brighter where the edge is stronger.
    """
    hog, blocks, channels = settings.hog, settings.blocks, split(patch, settings)
    descriptor = hog_descriptors(settings, settings.patch, settings.patch)[0]
    shape = blocks, blocks, hog.block, hog.block, hog.orientations  # x comes before y
    by_block = np.reshape(descriptor.compute(channels[0]), shape)
    count = settings.patch // hog.cell
    cells = np.full((count, count, hog.orientations), 1e-9)
    for x, y in np.ndindex(hog.block, hog.block):
        part = cells[x : x + blocks, y : y + blocks]
        np.maximum(part, by_block[:, :, x, y], out=part)
    strokes, bars = np.zeros((2, _DRAWN, _DRAWN, 3), np.uint8)
    for x, y, number in zip(
        *np.unravel_index(np.argsort(cells, axis=None), cells.shape), strict=True
    ):
        angle = np.pi * ((number + 0.5) / hog.orientations + 0.5)
        reach = 0.45 * np.array((np.cos(angle), np.sin(angle)))
        ends = (np.array((x, y)) + 0.5 + [-reach, reach]) * _DRAWN / count
        draw_lines(strokes, ends, (255 * cells[x, y, number] / cells.max(),) * 3, 1)
    for row, channel in enumerate(channels, start=1):
        counts = histogram(channel, settings.histogram.bins)
        tops = (row - 0.9 * counts / counts.max()) * _DRAWN / 3
        sides = np.linspace(0, _DRAWN, len(counts) + 1)
        for left, right, top in zip(sides, sides[1:], tops, strict=False):
            fill(bars, Box(left, top, right, row * _DRAWN / 3), color_of(row))
    enlarged = cv2.resize(patch, (_DRAWN, _DRAWN), interpolation=cv2.INTER_NEAREST)
    return np.hstack([enlarged, strokes, bars])


def blend_heat(image: Image, heat: Heat) -> Image:
    """Return the darkened image with the heat over it: black, red, white at the peak."""
    scale = 255 / heat.peak if heat.peak > 0 else 0
    shade = (heat.values * scale).astype(np.uint8)
    colored = cv2.applyColorMap(heat.enlarged(shade, image), cv2.COLORMAP_HOT)
    return np.asarray(cv2.addWeighted(image, 0.5, colored, 0.8, 0), np.uint8)
