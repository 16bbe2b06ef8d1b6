"""The windows of a frame, with what a detector says of each."""

from collections.abc import Callable, Sequence

import numpy as np

from vdet.boxes import Boxes, Float32Array, Int32Array, from_sizes
from vdet.config.schema import SvmSettings
from vdet.detect.protocol import DetectorModel
from vdet.detect.svm.detector import SvmDetector, horizon_of
from vdet.detect.svm.search import lay_grids
from vdet.detect.svm.windows import Windows
from vdet.errors import FrameSizeError
from vdet.learn.svm.mining.choosing import compare_windows
from vdet.media import Picture
from vdet.media.images import Image

WindowSearch = Callable[[Image], Windows]
"""Returns the windows of a frame with their probabilities."""


def search_windows(
    model: DetectorModel | None, width: int, height: int, images: Sequence[Image]
) -> WindowSearch:
    """Return a search of frames of this size; `images` are the first few.

    The windows of the linear model are its own. For another detector they are laid as the default
    settings of the linear model say, and a window has the score of the detection that it fits.
    Without a detector all windows have probability 1.

    Raises
    ------
    ImageError
        Such frames cannot be searched.
    """
    size = width, height
    detector = model.for_video(*size, images) if model else None
    if isinstance(detector, SvmDetector):
        return lambda image: detector.search(Picture(image), None).windows
    boxes = _default_windows(*size, images)
    if model is None:
        likely = _scored(boxes, np.ones(len(boxes), np.float32))
        return lambda _: likely

    def search(image: Image) -> Windows:
        still = model.for_video(*size, [image])
        return score_windows(boxes, still.detect(still.search(Picture(image), None)), width)

    return search


def _default_windows(width: int, height: int, images: Sequence[Image]) -> Int32Array:
    """Return the windows that the linear model searches by default, int32 `(n, 4)`.

    Raises
    ------
    FrameSizeError
        No window fits into such a frame.
    """
    svm = SvmSettings()
    grids = lay_grids(svm, svm.features, width, height, horizon=horizon_of(svm, images))
    if not grids:
        raise FrameSizeError(
            f"no window fits into a frame of {width}×{height} pixels; give a larger one"
        )
    return np.concatenate([grid.boxes for grid in grids])


def score_windows(boxes: Int32Array, detections: Boxes, frame_width: int) -> Windows:
    """Return windows with the highest score of the detections that each fits; 0 where none fits.

    Parameters
    ----------
    boxes
        int32 `(n, 4)`: x, y, width, height of square windows, frame pixels.
    """
    scores = np.zeros(len(boxes), np.float32)
    squares = from_sizes(boxes)
    for box, score in zip(detections.sides, detections.scores.tolist(), strict=True):
        fits = compare_windows(squares, box, frame_width).fits
        scores[fits] = np.maximum(scores[fits], score)
    return _scored(boxes, scores)


def _scored(boxes: Int32Array, scores: Float32Array) -> Windows:
    return Windows(boxes, scores, np.ones_like(scores), boxes.astype(np.float32))
