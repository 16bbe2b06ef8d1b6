"""Labelled pictures searched one by one, in parallel."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from vdet.boxes import Float64Array, to_sides
from vdet.detect.detections import Detections
from vdet.detect.protocol import DetectorModel
from vdet.labels.pictures.labelled import LabelledImage
from vdet.labels.rows import MAX_IN_FRAME
from vdet.run.pictures import search_picture
from vdet.run.threads import map_ordered


@dataclass(frozen=True, slots=True, eq=False)
class SearchedImage:
    """A labelled picture and what a detector finds in it.

    Attributes
    ----------
    width
        Width of the picture, pixels.
    boxes
        float64 `(n, 4)`: x, y, width, height of the detections, pixels, by descending score.
    scores
        float64 `(n,)`: their scores.
    """

    image: LabelledImage
    width: int
    boxes: Float64Array
    scores: Float64Array


def search_images(
    images: Sequence[LabelledImage],
    model: DetectorModel,
    *,
    threads: int = 1,
    advance: Callable[[int], object] = lambda _: None,
) -> list[SearchedImage]:
    """Search pictures, each for itself.

    Parameters
    ----------
    advance
        Called with 1 after each picture.

    Raises
    ------
    ImageError
        A picture cannot be read or searched; the message names it.
    """

    def search(image: LabelledImage) -> SearchedImage:
        picture = image.read()
        found = search_picture(image.path, picture, model)
        return _searched(image, picture.shape[1], found)

    searched = []
    with map_ordered(search, images, threads) as results:
        for _, result in results:
            searched.append(result)
            advance(1)
    return searched


def _searched(image: LabelledImage, width: int, found: Detections) -> SearchedImage:
    best = np.argsort(-found.scores, kind="stable")[:MAX_IN_FRAME]
    boxes = to_sides(found.boxes[best])
    return SearchedImage(image, width, boxes, found.scores[best].astype(np.float64))
