"""A patch → its feature vector: HOG and colour histogram of each channel, and the shrunk patch.

Sources: Dalal & Triggs, "Histograms of Oriented Gradients for Human Detection", 2005; seed
section 1.
"""

from collections.abc import Iterable

import cv2
import numpy as np
import numpy.typing as npt

from vdet.config.schema import FeatureSettings
from vdet.images import Image

Vectors = npt.NDArray[np.float32]

_CONVERSIONS = {
    "YCrCb": cv2.COLOR_BGR2YCrCb,
    "HSV": cv2.COLOR_BGR2HSV,
    "LUV": cv2.COLOR_BGR2LUV,
    "HLS": cv2.COLOR_BGR2HLS,
    "YUV": cv2.COLOR_BGR2YUV,
    "RGB": cv2.COLOR_BGR2RGB,
}


class FeatureExtractor:
    """Describes patches by the settings; holds OpenCV's descriptor, nothing that changes.

    A vector's parts, in order: HOG channel by channel (each as `cv2.HOGDescriptor.compute` gives
    it: block column by column, then down, then cell, then orientation), colour histogram channel
    by channel, spatial bins.
    """

    def __init__(self, settings: FeatureSettings) -> None:
        self.settings = settings
        self._hog = hog_descriptor(settings, (settings.patch, settings.patch))

    @property
    def hog_length(self) -> int:
        """HOG features of one channel; 1,568 for the seed's settings."""
        return self._hog.getDescriptorSize() if self.settings.hog.channels else 0

    @property
    def length(self) -> int:
        """Features of a patch; 4,800 for the seed's settings."""
        spatial = 3 * self.settings.spatial.size**2
        hog = self.hog_length * len(self.settings.hog.channels)
        return hog + 3 * self.settings.histogram.bins + spatial

    def describe(self, patch: Image) -> Vectors:
        """Describe one patch.

        Parameters
        ----------
        patch
            BGR uint8 of shape `(patch, patch, 3)`.

        Returns
        -------
        float32 of shape `(length,)`: HOG 0 to 1, histogram in pixels, spatial bins 0 to 255.
        """
        channels = np.ascontiguousarray(convert(patch, self.settings).transpose(2, 0, 1))
        parts: list[npt.ArrayLike] = []
        parts += [self._hog.compute(channels[i]) for i in self.settings.hog.channels]
        if self.settings.histogram.bins:
            parts += [histogram(channel, self.settings.histogram.bins) for channel in channels]
        if side := self.settings.spatial.size:
            parts += [cv2.resize(c, (side, side), interpolation=cv2.INTER_AREA) for c in channels]
        return np.concatenate([np.ravel(part) for part in parts], dtype=np.float32)

    def describe_all(self, patches: Iterable[Image]) -> Vectors:
        """Describe patches one by one; float32 of shape `(n, length)`."""
        vectors = [self.describe(patch) for patch in patches]
        return np.stack(vectors) if vectors else np.empty((0, self.length), np.float32)


def convert(image: Image, settings: FeatureSettings) -> Image:
    """Convert BGR to the settings' colour space; uint8 of the same shape `(H, W, 3)`."""
    return np.asarray(cv2.cvtColor(image, _CONVERSIONS[settings.color_space]), np.uint8)


def hog_descriptor(settings: FeatureSettings, window: tuple[int, int]) -> cv2.HOGDescriptor:
    """Return OpenCV's descriptor for a window of `(width, height)` pixels, blocks a cell apart."""
    hog = settings.hog
    block = hog.block * hog.cell
    cell = (hog.cell, hog.cell)
    return cv2.HOGDescriptor(window, (block, block), cell, cell, hog.orientations)


def histogram(channel: Image, bins: int) -> npt.NDArray[np.intp]:
    """Count the pixels of one channel in `bins` equal bins over 0 … 255; shape `(bins,)`."""
    return np.bincount(channel.ravel() // (256 // bins), minlength=bins)


def to_patch(image: Image, side: int) -> Image:
    """Resize a crop (BGR uint8) to a square patch of `side` pixels, bilinearly."""
    if image.shape[:2] == (side, side):
        return image
    return np.asarray(cv2.resize(image, (side, side), interpolation=cv2.INTER_LINEAR), np.uint8)
