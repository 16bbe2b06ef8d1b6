"""A patch → its feature vector: HOG and colour histogram of each channel.

Source: Dalal & Triggs, "Histograms of Oriented Gradients for Human Detection", 2005.
"""

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import Float32Array, Image
from vdet.config.kinds import FeatureSettings
from vdet.media.images import to_ycrcb

Channels = tuple[Image, Image, Image]
"""Luma, red and blue (YCrCb), uint8 `(H, W)` each; halved channels `(H / 2, W / 2)`."""


class FeatureExtractor:
    """Computes the feature vectors of patches; it has no state, so threads may share it.

    A vector begins with HOG, channel by channel, each as `cv2.HOGDescriptor.compute` gives it
    (blocks column by column from the top, then cells, then orientations). The colour histogram
    follows, channel by channel.
    """

    def __init__(self, settings: FeatureSettings) -> None:
        self.settings = settings
        self._descriptors = hog_descriptors(settings, settings.patch, settings.patch)

    def describe(self, patch: Image) -> Float32Array:
        """Compute the features of one patch.

        Parameters
        ----------
        patch
            BGR uint8 `(patch, patch, 3)`.

        Returns
        -------
        float32 `(settings.length,)`: HOG 0 to 1, histogram in pixels.
        """
        return self.describe_channels(split(patch, self.settings))

    def describe_channels(self, channels: Channels) -> Float32Array:
        """Compute the features of one patch from its channels."""
        pairs = zip(self._descriptors, channels, strict=True)
        hogs = [np.ravel(hog.compute(channel)) for hog, channel in pairs]
        histograms = [histogram(channel, self.settings.histogram.bins) for channel in channels]
        return np.concatenate([*hogs, *histograms], dtype=np.float32)


def split(image: Image, settings: FeatureSettings) -> Channels:
    """Return the channels of an image, BGR uint8 `(H, W, 3)`."""
    luma, red, blue = (
        halve(channel) if number in settings.halved else channel
        for number, channel in enumerate(to_ycrcb(image))
    )
    return luma, red, blue


def hog_descriptors(settings: FeatureSettings, width: int, height: int) -> list[cv2.HOGDescriptor]:
    """Return OpenCV's descriptor of each channel, with blocks a cell apart.

    Width and height are pixels of the patch; a halved channel has half of them.
    """
    hog, descriptors = settings.hog, []
    for shrink in map(settings.shrink, range(3)):
        side, window = hog.cell // shrink, (width // shrink, height // shrink)
        block, cell = (hog.block * side,) * 2, (side, side)
        descriptors.append(cv2.HOGDescriptor(window, block, cell, cell, hog.orientations))
    return descriptors


def histogram(channel: Image, bins: int) -> npt.NDArray[np.intp]:
    """Count the pixels of one channel in `bins` equal bins over 0 … 255; shape `(bins,)`."""
    return np.bincount(channel.ravel() // (256 // bins), minlength=bins)


def cut_window(image: Image, x: int, y: int, width: int, height: int) -> Image:
    """Return a window of an image; outside the image, the outermost pixels are repeated."""
    rows = np.arange(y, y + height).clip(0, image.shape[0] - 1)
    columns = np.arange(x, x + width).clip(0, image.shape[1] - 1)
    return np.asarray(image[rows[:, np.newaxis], columns])


def resize(image: Image, width: int, height: int) -> Image:
    """Resize an image so that each of its pixels counts.

    It is halved (each pixel the mean of four) while it is at least twice as large and both sides
    are even. Then it is resized bilinearly, or by area if it is still at least twice as large.
    """
    while (
        image.shape[0] >= 2 * height
        and image.shape[1] >= 2 * width
        and image.shape[0] % 2 == image.shape[1] % 2 == 0
    ):
        image = halve(image)
    if image.shape[:2] == (height, width):
        return image
    shrinks = image.shape[0] >= 2 * height or image.shape[1] >= 2 * width
    method = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(image, (width, height), interpolation=method), np.uint8)


def halve(image: Image) -> Image:
    """Return an image of even sides at half its size, each pixel the mean of four."""
    half = (image.shape[1] // 2, image.shape[0] // 2)
    return np.asarray(cv2.resize(image, half, interpolation=cv2.INTER_AREA), np.uint8)
