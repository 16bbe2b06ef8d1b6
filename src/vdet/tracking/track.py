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
        Average of the car's last rectangles (`tracker.history` of them), rounded to whole pixels
        of the full frame. It is not clipped; the rectangles that it averages lie in the frame.
    from_match
        Whether this frame's detection is a template match alone, without heat to back it.
    """

    id: int
    box: Box
    from_match: bool
