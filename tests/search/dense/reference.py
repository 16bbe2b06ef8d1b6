"""What the dense engine is held to: the patch engine, with models fitted to generated patches."""

import functools
from dataclasses import dataclass

import numpy as np

from vdet.config.schema import FeatureSettings, HogSettings, WindowSettings
from vdet.features import FeatureExtractor, to_patch
from vdet.images import Image
from vdet.model import LinearModel
from vdet.search.dense import dense_search
from vdet.search.patch import PatchSearch
from vdet.search.pyramid import FramePyramid
from vdet.synthetic import background_patches, default_clip, render, vehicle_patches
from vdet.windows import Floats, WindowGrid, lay_grid

SEED_FEATURES = FeatureSettings(patch=64, hog=HogSettings(cell=8))
_EACH = 120  # patches of a class


@dataclass(frozen=True, slots=True)
class Scores:
    """The log-odds of the same windows by the dense engine and by the patch engine."""

    dense: Floats
    patch: Floats

    @property
    def correlation(self) -> float:
        return float(np.corrcoef(self.dense, self.patch)[0, 1])

    @property
    def same(self) -> float:
        """The share of windows about which the engines decide alike."""
        return float(np.mean((self.dense >= 0) == (self.patch >= 0)))


def compare(model: LinearModel, grids: list[WindowGrid], image: Image) -> Scores:
    """Search a frame with both engines."""
    frame = FramePyramid(image)
    dense = [dense_search(model, grid).search(frame) for grid in grids]
    patch = [PatchSearch(model, grid).search(frame) for grid in grids]
    return Scores(log_odds(np.concatenate(dense)), log_odds(np.concatenate(patch)))


def log_odds(probabilities: Floats) -> Floats:
    # Beyond a millionth, what is left of a probability's distance from 0 or 1 is rounding.
    sure = np.clip(probabilities.astype(np.float64), 1e-6, 1 - 1e-6)
    return np.asarray(np.log(sure / (1 - sure)), np.float32)


def fitted(features: FeatureSettings, members: int = 1) -> LinearModel:
    """Fit a model by ridge regression; each member has seen other patches."""
    patches, labels = _patches()
    extractor = FeatureExtractor(features)
    vectors = extractor.describe_all(to_patch(patch, features.patch) for patch in patches)
    parts = [np.arange(len(labels)) % (members + 1) != i for i in range(members)]
    fits = [_ridge(vectors[part].astype(np.float64), labels[part]) for part in parts]
    weights, biases = (np.array(each, np.float32) for each in zip(*fits, strict=True))
    slopes = np.full(members, -4, np.float32)
    return LinearModel(features, weights, biases, slopes, np.zeros(members, np.float32))


def _ridge(vectors: Floats, labels: Floats) -> tuple[Floats, float]:
    mean, deviation = vectors.mean(axis=0), vectors.std(axis=0) + 1e-3
    scaled = (vectors - mean) / deviation
    kernel = scaled @ scaled.T / scaled.shape[1] + np.eye(len(labels))
    weights = scaled.T @ np.linalg.solve(kernel, labels) / scaled.shape[1] / deviation
    return weights, float(-mean @ weights)


@functools.cache
def _patches() -> tuple[list[Image], Floats]:
    rng = np.random.default_rng(1)
    patches = [*vehicle_patches(_EACH, rng), *background_patches(_EACH, rng)]
    return patches, np.repeat(np.array([1, -1], np.float32), _EACH)


@functools.cache
def road(width: int = 1280, height: int = 720) -> Image:
    """Give a frame of the demo's clip: cars of a 17th, an 11th and an 8th of its width."""
    return render(default_clip(1, width=width, height=height), 200)


def cars() -> Image:
    """Give the part of `road` where its cars are, 440 × 200 pixels."""
    return road()[360:560, 560:1000]


def grid_of(size: int, *, overlap: float | None = None, step: int | None = None) -> WindowGrid:
    """Lay windows of 48 to 128 pixels over `cars`; a patch has eight cells."""
    settings = WindowSettings(size=size, overlap=overlap, step=step, top=8, bottom=size + 52)
    return lay_grid(settings, 440, 200)
