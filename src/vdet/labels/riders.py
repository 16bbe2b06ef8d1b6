"""Riders and what they ride: one object, as most sets of traffic pictures label them."""

from collections.abc import Sequence
from dataclasses import astuple

from vdet.boxes import Box
from vdet.detect.classes import letters, our_name
from vdet.labels.label import Label
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
            covered, machine = max((_covered(rider, labels[n]), n) for n in machines)
            if covered >= _MIN_COVERED:
                around = Box(*merged[machine].box).union(Box(*rider.box))
                merged[machine] = merged[machine]._replace(box=astuple(around))
                del merged[row]
    return list(merged.values())


def _covered(rider: Label, machine: Label) -> float:
    """Return the fraction of a rider's box that the box of a machine covers."""
    box = Box(*rider.box)
    return box.intersection(Box(*machine.box)).area / box.area if box.area else 0.0
