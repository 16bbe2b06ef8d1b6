"""The tracks of a video as predictions, in any format that `vdet detect-video --tracks` writes."""

from pathlib import Path

from vdet.labels.registry import read_tracks
from vdet.labels.video import LabelledVideo


def read_predictions(path: Path) -> LabelledVideo:
    """Read tracks.

    Tracks without a score have score 1. Two different times give the frame rate, and the last frame
    that is listed gives the number of frames. An empty `.txt` means that nothing was found.

    Raises
    ------
    TruthError
        The file cannot be read, or has a mistake; the message names its place.
    """
    saved = read_tracks(path)
    return LabelledVideo.from_rows(saved.rows, frame_count=saved.frame_count, rate=saved.rate)
