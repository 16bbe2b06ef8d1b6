"""Size and distance of regions, alone and combined, as the association rules ask for them."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import combinations

from vdet.config.schema import TrackerSettings
from vdet.detect.svm.heat import Region
from vdet.geometry import Box


def large_enough(
    regions: Iterable[Region], frame_width: int, frame_height: int, settings: TrackerSettings
) -> list[Region]:
    """Return the regions, clipped to the frame, that are not narrower or lower than allowed.

    Rule 1. What a region has outside the frame does not count.
    """
    least = max(1, settings.min_region)
    clipped = [replace(r, box=r.box.clipped(frame_width, frame_height)) for r in regions]
    return [r for r in clipped if r.box.width >= least and r.box.height >= least]


def is_good_size(region: Box, car: Box, settings: TrackerSettings) -> bool:
    """Tell whether a region is wide enough to be all of the car (rules 7 and 8)."""
    return region.width > settings.wide or region.width > settings.good_fraction * car.width


def is_about_size(combined: Box, car: Box, settings: TrackerSettings) -> bool:
    """Tell whether two regions, combined, are about as wide as the car (rules 9 and 10)."""
    return abs(combined.width - car.width) <= settings.combined_tolerance * car.width


def combine(first: Region, second: Region) -> Region:
    """Return the two as one: box around both, centroids weighted by box area, higher peak."""
    one, two = first.box.area, second.box.area
    (x1, y1), (x2, y2) = first.centroid, second.centroid
    centroid = (x1 * one + x2 * two) / (one + two), (y1 * one + y2 * two) / (one + two)
    return Region(first.box.union(second.box), centroid, max(first.peak, second.peak))


def any_overlap(boxes: Sequence[Box], pixels: int) -> bool:
    """Tell whether two of the boxes overlap by more than `pixels`, across and down (rule 4)."""
    common = (a.intersection(b) for a, b in combinations(boxes, 2))
    return any(box.width > pixels and box.height > pixels for box in common)
