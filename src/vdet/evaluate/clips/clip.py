"""A video with its truth, and the boxes that are found in it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from vdet.config.schema import Settings
from vdet.detect.svm.model import LinearModel
from vdet.errors import ImageError, VideoError
from vdet.evaluate.clips.following import follow_under_all
from vdet.evaluate.labelled_video import LabelledVideo, Row
from vdet.evaluate.truth import read_truth
from vdet.media import VideoReader
from vdet.track.track import Track

Advance = Callable[[int], object]
Progress = Callable[[int | None], Advance]


@dataclass(frozen=True, slots=True, eq=False)
class Clip:
    """A video and the truth of its first frames; `until` is the last of these, None for all."""

    video: Path
    truth_path: Path
    truth: LabelledVideo
    until: int | None


def open_clip(video: Path, truth_path: Path, until: int | None = None) -> Clip:
    """Read the truth of a video.

    Parameters
    ----------
    until
        Number of the last frame to look at, from 1; without it, the last that the truth knows of.

    Raises
    ------
    TruthError
        The truth cannot be used.
    """
    truth = read_truth(truth_path)
    if until is not None:
        truth = truth.until(until)
    return Clip(video, truth_path, truth, until or truth.last_frame or None)


def detect(
    clip: Clip, model: LinearModel, variants: Sequence[Settings], progress: Progress
) -> list[LabelledVideo]:
    """Find and follow the cars of a clip under each of the settings, in one pass.

    Parameters
    ----------
    progress
        Called with the expected number of frames (None: unknown); what it returns is called with
        the number of frames done since the last call.

    Raises
    ------
    VideoError
        The video cannot be read or searched.
    TruthError
        The truth knows of frames beyond the end of the video.
    """
    rows: list[list[Row]] = [[] for _ in variants]
    frames = 0
    with VideoReader(clip.video, frames=clip.until, settings=variants[0].input) as reader:
        info = reader.info
        advance = progress(reader.expected)
        try:
            for frame, found in follow_under_all(reader, model, variants, info.width, info.height):
                for row, tracks in zip(rows, found, strict=True):
                    row += [_row(frame.index + 1, track) for track in tracks]
                frames = frame.index + 1
                advance(1)
        except ImageError as error:
            raise VideoError(f"{clip.video}: {error}") from error
    if clip.until is not None and frames < clip.until:
        read_truth(clip.truth_path, frame_count=frames)  # refuses it, and names the line
    return [
        LabelledVideo.from_rows(each, frame_count=frames, rate=float(info.rate)) for each in rows
    ]


def _row(number: int, track: Track) -> Row:
    box = track.box
    return Row(0, number, track.id, box.x, box.y, box.width, box.height)
