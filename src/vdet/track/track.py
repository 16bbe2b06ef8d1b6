"""What a tracker says about a frame."""

from dataclasses import dataclass

from vdet.geometry import Box


@dataclass(frozen=True, slots=True)
class Track:
    """A vehicle as it is shown in one frame.

    Attributes
    ----------
    id
        1, 2, 3 … in the order in which the vehicles of a video are first shown; an id is never
        used again for another vehicle.
    box
        Its place, whole pixels of the full frame. From the motion tracker: the estimate for this
        frame, the part inside the frame. From the rules: the average of the car's last rectangles
        (`tracker.history` of them), which lie in the frame.
    score
        0 to 1: the share of shown boxes with such a score that are vehicles.
    predicted
        Whether the detector did not see the vehicle in this frame: it is shown where its motion
        leads or, by the rules, where its image was found again.
    class_id
        Its class as the detector numbers them (`Detections.names`); None where the detector does
        not tell classes.
    """

    id: int
    box: Box
    score: float
    predicted: bool
    class_id: int | None = None
