"""Labelled pictures searched one by one, in parallel."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from vdet.boxes import Boxes, Float64Array
from vdet.detect.protocol import DetectorModel
from vdet.labels.label import MAX_IN_FRAME
from vdet.labels.pictures import LabelledPicture
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
        float64 `(n, 4)`: x1, y1, x2, y2 of the detections, pixels, by descending score.
    scores
        float64 `(n,)`: their scores.
    """

    image: LabelledPicture
    width: int
    boxes: Float64Array
    scores: Float64Array


def search_images(
    images: Sequence[LabelledPicture],
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

    def search(image: LabelledPicture) -> SearchedImage:
        picture = image.read()
        found = search_picture(image.path, picture, model)
        return _searched(image, picture.shape[1], found)

    searched = []
    with map_ordered(search, images, threads) as results:
        for _, result in results:
            searched.append(result)
            advance(1)
    return searched


def _searched(image: LabelledPicture, width: int, found: Boxes) -> SearchedImage:
    best = np.argsort(-found.scores, kind="stable")[:MAX_IN_FRAME]
    return SearchedImage(image, width, found.sides[best], found.scores[best])
