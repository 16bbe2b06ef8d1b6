"""The dense engine compared with the patch engine, with models fitted to generated patches."""

import functools
from dataclasses import dataclass
from itertools import islice

import numpy as np
import numpy.typing as npt
from benchmarks.searches import PatchSearch

from drawn_patches import GROUPS, draw_patches
from seed import SEED
from vdet.boxes import Float32Array, Image
from vdet.config.kinds import FeatureSettings, WindowSettings
from vdet.detect.svm.model import BoxRegression, LinearModel, describe, resize, split
from vdet.detect.svm.windows import WINDOW_SIDES, DenseSearch, FramePyramid, WindowGrid, band_grid
from vdet.media import Picture, Planes
from vdet.synthetic import Renderer, demo_scene

Exact = npt.NDArray[np.float64]

SEED_FEATURES = SEED.svm.features
_EACH = 60  # patches of each group


@dataclass(frozen=True, slots=True)
class EngineResults:
    """The log-odds of the same windows from the dense engine and from the patch engine.

    The sides are those of the windows that are hits of both, `(n, 4)`.
    """

    dense: Float32Array
    patch: Float32Array
    dense_sides: Float32Array
    patch_sides: Float32Array

    @property
    def correlation(self) -> float:
        return float(np.corrcoef(self.dense, self.patch)[0, 1])

    @property
    def same(self) -> float:
        """The fraction of windows that both engines put on the same side of probability 0.5."""
        return float(np.mean((self.dense >= 0) == (self.patch >= 0)))

    @property
    def sides_apart(self) -> float:
        """The largest difference of a side, in sides of the window."""
        return float(np.abs(self.dense_sides - self.patch_sides).max())


def compare(model: LinearModel, grids: list[WindowGrid], pixels: Image | Planes) -> EngineResults:
    """Search a frame with both engines."""
    frame = _pyramid(pixels, model.features, grids)
    dense, patch = (
        [engine(model, grid).search(frame, 0.5) for grid in grids]
        for engine in (DenseSearch, PatchSearch)
    )
    odds = [log_odds(np.concatenate([found for found, _ in engine])) for engine in (dense, patch)]
    hits = (odds[0] >= 0) & (odds[1] >= 0)
    sides = [np.concatenate([found for _, found in engine])[hits] for engine in (dense, patch)]
    return EngineResults(*odds, *sides)


def _pyramid(
    pixels: Image | Planes, features: FeatureSettings, grids: list[WindowGrid]
) -> FramePyramid:
    """Return a frame with a margin for windows beyond its sides, whole pixels at all levels."""
    margin = -16 * min(0, *(int(grid.left // 16) for grid in grids))
    return FramePyramid(Picture(pixels), features, margin=margin)


def log_odds(probabilities: Float32Array) -> Float32Array:
    # Nearer to 0 or 1 than a millionth, probabilities differ by rounding only.
    bounded = np.clip(probabilities.astype(np.float64), 1e-6, 1 - 1e-6)
    return np.asarray(np.log(bounded / (1 - bounded)), np.float32)


def fitted(features: FeatureSettings, members: int = 1) -> LinearModel:
    """Fit a model by ridge regression, each member on other patches."""
    patches, labels = _patches()
    crops = [resize(patch, features.patch, features.patch) for patch in patches]
    vectors = np.stack([describe(split(crop, features), features) for crop in crops])
    parts = [np.arange(len(labels)) % (members + 1) != i for i in range(members)]
    fits = [_ridge(vectors[part].astype(np.float64), labels[part]) for part in parts]
    weights, biases = (np.array(item, np.float32) for item in zip(*fits, strict=True))
    slopes = np.full(members, -4, np.float32)
    factors = np.array([[1], [-0.5], [0.5], [-1]], np.float32)
    boxes = BoxRegression(factors * weights[0, : features.hog_length], WINDOW_SIDES)
    return LinearModel(
        features, weights, biases, slopes, np.zeros(members, np.float32), box_regression=boxes
    )


def _ridge(vectors: Exact, targets: Exact) -> tuple[Exact, Exact]:
    """Return weights `(n,)` or `(n, m)` and biases for targets `(k,)` or `(k, m)` of mean 0."""
    mean, deviation = vectors.mean(axis=0), vectors.std(axis=0) + 1e-3
    scaled = (vectors - mean) / deviation
    kernel = scaled @ scaled.T / scaled.shape[1] + np.eye(len(targets))
    weights = scaled.T @ np.linalg.solve(kernel, targets) / scaled.shape[1]
    weights = (weights.T / deviation).T
    return weights, -mean @ weights


@functools.cache
def _patches() -> tuple[list[Image], Float32Array]:
    rng = np.random.default_rng(1)
    patches = [patch for group in GROUPS for patch in islice(draw_patches(group, rng), _EACH)]
    return patches, np.repeat(np.array([1, 1, -1, -1], np.float32), _EACH)


@functools.cache
def road(width: int = 1280, height: int = 720) -> Image:
    """Return a frame of the demo's clip: cars of a 17th, an 11th and an 8th of its width."""
    return Renderer(demo_scene(7, width=width, height=height)).image(200)


def cars() -> Image:
    """Return the part of `road` where its cars are, 440 × 200 pixels."""
    return road()[360:560, 560:1000]


def grid_of(size: int, *, overlap: float) -> WindowGrid:
    """Lay windows of 48 to 128 pixels over `cars`; an eighth of a window is a cell."""
    settings = WindowSettings(size=size, overlap=overlap, top=8, bottom=size + 52)
    return band_grid(settings, 440, 200)
