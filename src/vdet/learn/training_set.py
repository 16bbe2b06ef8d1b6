"""The part of the patches that a model learns from, each with its views."""

from dataclasses import dataclass

import numpy as np

from vdet.detect.svm.features import Vectors
from vdet.learn.extraction import Flags, LabelledVectors, Rows, SidesTable


@dataclass(frozen=True, slots=True, eq=False)
class Lesson:
    """Patches and views to learn from, row by row, the patches first.

    `vectors` is float32 of shape `(n, features)`, `vehicle` bool of shape `(n,)`, `sides` `(n, 4)`;
    `origins` is intp of shape `(n,)`, the row of the patch that each is a view of, its own for a
    patch itself.
    """

    vectors: Vectors
    vehicle: Flags
    sides: SidesTable
    origins: Rows


def lesson_of(data: LabelledVectors, kept: Flags) -> Lesson:
    """Take the kept patches, bool of shape `(n,)`, and the views of these alone."""
    count = int(np.count_nonzero(kept))
    sides = np.full((len(kept), 4), np.nan, np.float32) if data.sides is None else data.sides
    patches = Lesson(data.vectors[kept], data.vehicle[kept], sides[kept], np.arange(count))
    views = data.views
    if views is None or not len(views.origins):
        return patches
    seen = kept[views.origins]
    places = np.cumsum(kept) - 1
    return Lesson(
        np.concatenate([patches.vectors, views.vectors[seen]]),
        np.concatenate([patches.vehicle, views.vehicle[seen]]),
        np.concatenate([patches.sides, views.sides[seen]]),
        np.concatenate([patches.origins, places[views.origins[seen]]]),
    )
