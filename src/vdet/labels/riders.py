"""Riders and what they ride: one object, as most sets of traffic pictures label them."""

from collections.abc import Sequence

from vdet.detect.classes import letters, our_name
from vdet.labels.label import Corners, Label
from vdet.labels.roles import RIDER

_MACHINES = ("motorcycle", "bicycle")
_MIN_COVERED = 0.1  # fraction of a rider's box that the box of what is ridden covers


def merge_riders(labels: Sequence[Label]) -> list[Label]:
    """Return labels in which a rider is part of the motorcycle or bicycle below.

    A rider belongs to the one that covers most of the rider's box. One without remains.
    """
    machines = [row for row, label in enumerate(labels) if our_name(label.name or "") in _MACHINES]
    merged = dict(enumerate(labels))
    for row, rider in enumerate(labels):
        if machines and letters(rider.name or "") == RIDER:
            covered, machine = max((_covered(rider.box, labels[n].box), n) for n in machines)
            if covered >= _MIN_COVERED:
                around = _around(merged[machine].box, rider.box)
                merged[machine] = merged[machine]._replace(box=around)
                del merged[row]
    return list(merged.values())


def _covered(box: Corners, other: Corners) -> float:
    """Return the fraction of a box that another covers."""
    width = min(box[2], other[2]) - max(box[0], other[0])
    height = min(box[3], other[3]) - max(box[1], other[1])
    area = (box[2] - box[0]) * (box[3] - box[1])
    return max(width, 0) * max(height, 0) / area if area > 0 else 0.0


def _around(box: Corners, other: Corners) -> Corners:
    left, top, right, bottom = zip(box, other, strict=True)
    return min(left), min(top), max(right), max(bottom)
