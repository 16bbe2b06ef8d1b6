"""Jump cuts: where a video was put together of several.

From one frame to the next, both the edges and the levels of grey change as they do nowhere nearby.
A flash or a wiper passes, and a change of the exposure leaves the edges where they are.
"""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain, repeat
from statistics import median
from typing import Generic, TypeVar

import cv2
import numpy as np

from vdet.boxes import Float32Array, Float64Array
from vdet.media import Frame

Item = TypeVar("Item")

_SIZE = 64, 36
"""Columns and rows of the small plane of a frame."""
_LEVELS = 16
"""Number of levels of grey in its histogram."""
_EDGES, _GREYS = 0.25, 0.06
"""Minimum change at a cut: one minus the correlation of edges, and the fraction of pixels with
another level. Frames of fixed cameras change by 0.1 and 0.02 at most, those of driving ones by 0.4
and 0.08; half of 400 cuts change by 0.97 and 0.39 at least, and 1 in 100 by less than 0.33 and 0.1.
"""
_LARGEST, _USUAL, _GREYEST = 1.4, 3.0, 1.5
"""The same as multiples of the largest and of the usual change of edges nearby, and of greys."""
_STAYS = 0.6
"""Minimum change of edges from the frame before a cut to each of the next ones, as a fraction of
that at the cut.
"""
_NEARBY, _FEWEST = 25, 3
"""Number of changes before a cut that are nearby, and their minimum number."""
_AFTER, _NEXT = 0.2, 2
"""Seconds after a cut that are nearby, and minimum number of frames then."""
_GAP = 1.5
"""Maximum seconds between two frames, as a multiple of the usual: after more, frames are lost."""


@dataclass(frozen=True, slots=True, eq=False)
class _Signature:
    """What a frame looks like: its time, its edges (of norm 1), and its levels of grey."""

    time: float
    edges: Float32Array
    greys: Float64Array

    @classmethod
    def of(cls, frame: Frame) -> "_Signature":
        layer = frame.picture.layers[0]  # luma, or BGR, of which green is enough
        step = max(1, layer.shape[1] // (4 * _SIZE[0]))
        pixels = np.ascontiguousarray(
            np.atleast_3d(layer[::step, ::step])[..., int(layer.ndim == 3)]
        )
        small = cv2.resize(pixels, _SIZE, interpolation=cv2.INTER_AREA)
        greys = np.bincount((small // (256 // _LEVELS)).ravel(), minlength=_LEVELS) / small.size
        plane = small.astype(np.float32)
        edges = np.clip(plane - cv2.blur(plane, (5, 5)), -20, 20)
        edges -= edges.mean()
        norm = max(1e-3, float(np.linalg.norm(edges)))
        return cls(float(frame.time), np.asarray(edges / norm, np.float32), greys)


@dataclass(frozen=True, slots=True)
class _FrameChange:
    """How a frame differs from another: of the edges, of the greys, and in seconds."""

    edges: float
    greys: float
    seconds: float

    @classmethod
    def of(cls, before: _Signature, after: _Signature) -> "_FrameChange":
        edges = 1 - float((before.edges * after.edges).sum())
        greys = float(np.abs(before.greys - after.greys).sum()) / 2
        return cls(edges, greys, after.time - before.time)

    def stands_out(self, nearby: Sequence["_FrameChange"]) -> bool:
        """Return whether it is far larger than those nearby."""
        if self.edges < _EDGES or self.greys < _GREYS or len(nearby) < _FEWEST:
            return False
        edges = [change.edges for change in nearby]
        return (
            self.edges >= max(_LARGEST * max(edges), _USUAL * median(edges))
            and self.greys >= _GREYEST * max(change.greys for change in nearby)
            and self.seconds <= _GAP * median(change.seconds for change in nearby)
        )


@dataclass(slots=True, eq=False)
class _Suspect(Generic[Item]):
    """A change that may be a cut, the signatures before and after it, and what waits since then."""

    change: _FrameChange
    before: _Signature
    after: _Signature
    items: list[Item]
    ahead: list[_FrameChange] = field(default_factory=list)

    def holds(self, nearby: Iterable[_FrameChange], look: _Signature) -> bool:
        """Return whether it may still be a cut after the next signature."""
        stays = _FrameChange.of(self.before, look).edges >= _STAYS * self.change.edges
        return stays and self.change.stands_out([*nearby, *self.ahead])

    def decided(self, *, is_cut: bool) -> Iterator[tuple[Item, bool]]:
        """Yield what waits."""
        return zip(self.items, chain([is_cut], repeat(False)), strict=False)


def with_cuts(items: Iterable[tuple[Frame, Item]]) -> Iterator[tuple[Item, bool]]:
    """Yield the item of each frame of a video, and whether a jump cut comes before it.

    Items wait only where there may be a cut.
    """
    nearby: deque[_FrameChange] = deque(maxlen=_NEARBY)
    last: _Signature | None = None
    suspect: _Suspect[Item] | None = None
    for frame, item in items:
        before, last = last, _Signature.of(frame)
        if before is None:
            yield item, False
            continue
        change = _FrameChange.of(before, last)
        if suspect:
            suspect.items.append(item)
            suspect.ahead.append(change)
            is_cut = suspect.holds(nearby, last)
            is_early = len(suspect.ahead) < _NEXT or last.time - suspect.after.time < _AFTER
            if is_cut and is_early:
                continue
            yield from suspect.decided(is_cut=is_cut)
            nearby.extend(suspect.ahead if is_cut else [suspect.change, *suspect.ahead])
            suspect = None
        elif change.stands_out(nearby):
            suspect = _Suspect(change, before, last, [item])
        else:
            nearby.append(change)
            yield item, False
    if suspect:
        yield from suspect.decided(is_cut=len(suspect.ahead) >= _NEXT)
