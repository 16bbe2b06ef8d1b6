"""What is counted: events."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Event:
    """A vehicle crosses a line, or enters, leaves, appears in or vanishes from a zone.

    Attributes
    ----------
    time
        Seconds, as the frames of the video count them; interpolated between two frames.
    frame
        Number of the first frame at or after it, from 0.
    name
        Of the line or zone.
    direction
        As the user named it; of a zone enter, exit, appear (it is first seen inside) or vanish (it
        is last seen inside).
    id
        Of the track.
    class_name
        Class of the vehicle; None where the detector does not tell classes.
    score
        0 to 1: that of the track in `frame`.
    stitched
        Whether the vehicle was followed as another track before, so that this one's id alone would
        not show it.
    seconds
        How long the vehicle was in the zone, for exit and vanish; else None.
    """

    time: float
    frame: int
    name: str
    direction: str
    id: int
    class_name: str | None
    score: float
    stitched: bool
    seconds: float | None = None
