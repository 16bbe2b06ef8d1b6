"""Small scenes of boxes for the tests of the metrics."""

from labels.saving import Row, checked_video, row
from vdet.labels.label import SavedTracks

TEN = range(10)


def drive(id_: int, frames: range, x: float = 0, width: float = 100) -> list[Row]:
    """Return a box of 100 pixels height that stands at `x` in these frames."""
    return [row(0, frame, id_, x, 0, width, 100) for frame in frames]


def video(*tracks: list[Row]) -> SavedTracks:
    """Return the rows of all tracks as a video."""
    return checked_video([row for track in tracks for row in track])
