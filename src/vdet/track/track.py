"""What the tracker says about a frame."""

from dataclasses import dataclass

from vdet.geometry import Box


@dataclass(frozen=True, slots=True)
class Track:
    """A car as it is shown in one frame.

    Attributes
    ----------
    id
        1, 2, 3 … in the order in which the cars of a video are first shown; never used again for
        another car.
    box
        Where it is, whole pixels of the full frame. Of the motion tracker: its estimate for this
        frame, the part inside the frame. Of the original's rules: the average of the car's last
        rectangles (`tracker.history` of them), which lie in the frame.
    from_match
        Whether the frame has no region for the car: it is shown where its motion leads, or, by the
        original's rules, where its image was found again.
    """

    id: int
    box: Box
    from_match: bool
